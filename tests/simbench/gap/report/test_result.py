"""The answer in words: one sentence, and what a terminal shows below it."""

from types import SimpleNamespace

from simbench.gap.closed_loop.remaining import Remaining
from simbench.gap.report.result import Gap, GapReport, Ranked, numbers, words
from simbench.gap.stiction.conclusion import Conclusion
from simbench.scenarios import spec
from simbench.workbench import Loop

LOOP = Loop(
    plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
    controller={"type": "PI", "Kc": 1, "Ti": 10},
    sampling={"Ts": 1, "n": 100},
)


def corrected(effects):
    """Return the loop, with stiction where that is among the effects."""
    sticky = {"valve": {"model": "choudhury", "S": 6.04, "J": 3.0}}
    return spec.Loop.from_table(LOOP.with_all(sticky if "stiction" in effects else {}).to_table())


DETAILS = SimpleNamespace(loops=SimpleNamespace(corrected=corrected))
STUCK = {
    "block": "valve",
    "effect": "stiction",
    "parameters": {"S": 6.04, "J": 3.0},
    "probability": 0.914,
}
COARSE = {
    "block": "sensor",
    "effect": "quantisation",
    "parameters": {"step": 0.3, "at": "record"},
    "probability": 0.05,
}
RANKING = (
    Ranked("stiction", "valve", 0.914, 4.0, 1.25, {"S": 6.04, "J": 3.0}),
    Ranked("none", "none", 0.051, 4.0, 4.0, {}),
    *(Ranked(f"effect_{i}", "process", 0.007, None, None, {}) for i in range(5)),
)
SHARES = {
    "controller": 0.004,
    "valve": 0.914,
    "process": 0.006,
    "sensor": 0.07,
    "disturbance": 0.006,
}

CONCLUSION = Conclusion("stiction", 0.9, "stiction", "friction explains it", "confirm on the valve")


def report(
    effect="stiction",
    block="valve",
    effects=(STUCK,),
    *,
    gap=(4.0, 3.5, 1.25, 0.8, True, 0.8),
    value=0.859,
    **more,
):
    shrinkage = None if value is None else {"value": value, "lo": value - 0.1, "hi": value + 0.05}
    given = {
        "group": ("stiction",),
        "ranking": RANKING,
        "remaining": (),
        "blocks": SHARES,
        "next_test": {"test": "bump", "says": "bump it"},
        "notes": ("one", "two"),
    } | more
    return GapReport(
        block,
        effect,
        effects,
        given["group"],
        given["ranking"],
        Gap(*gap),
        shrinkage,
        given["remaining"],
        given["blocks"],
        given["next_test"],
        given["notes"],
        CONCLUSION,
        DETAILS,
    )


def test_an_effect_is_named_with_its_numbers_and_how_much_of_the_gap_it_closes():
    lacks = "The simulation lacks stiction (valve, S = 6.04, J = 3 % of travel), probability 0.91"
    reduced = "adding it reduces the gap (4.00 before, 1.25 after)"
    assert report().sentence() == f"{lacks}; {reduced}."
    assert report(value=None).sentence() == f"{lacks}."
    wider = report(value=-0.25, gap=(4.0, 3.5, 4.8, 0.8, True, 0.8)).sentence()
    assert wider.endswith("adding it does not reduce the gap (4.00 before, 4.80 after).")
    both = report(effects=(STUCK, COARSE)).sentence()
    assert (
        "stiction (valve, S = 6.04, J = 3 % of travel) and quantisation (sensor, step = 0.3 PV"
        " units, at = record)," in both
    )


def test_an_unknown_effect_is_placed_and_compared_with_the_nearest():
    something = {"block": "process", "effect": "unknown", "parameters": {}, "probability": 0.62}
    sentence = report("unknown", "process", (something,), value=None).sentence()
    assert (
        sentence
        == "Something is missing in the process block that no known effect explains (probability"
        " 0.62); closest: stiction, with which the gap is 1.25 of 4.00."
    )


def test_none_is_an_answer():
    nothing = {"block": "none", "effect": "none", "parameters": {}, "probability": 0.9}
    sentence = report("none", "none", (nothing,), value=None).sentence()
    assert sentence.startswith("No unmodelled effect is needed")


def test_five_of_the_differences_that_remain_are_put_into_words():
    left = tuple(
        Remaining(f"size {i} (PV units)", "sensor", 1.0 + i, (0.25, 0.5), 9.0 - i) for i in range(6)
    )
    text = report(remaining=left).as_text()
    assert "  sensor: size 0 (PV units) is 1, simulated 0.25 to 0.5\n" in text
    assert "size 4" in text
    assert "size 5" not in text
    assert "What remains" not in report().as_text()
    assert report(remaining=left).as_json()["remaining"][5] == {
        "feature": "size 5 (PV units)",
        "block": "sensor",
        "recorded": 6.0,
        "simulated": [0.25, 0.5],
        "distance": 4.0,
    }


def test_a_terminal_shows_six_candidates_and_blocks_of_half_a_percent_and_more():
    lines = report().as_text().splitlines()
    assert lines[1:7] == ["", "The valve:", *CONCLUSION.as_lines(), ""]
    assert lines[7:12] == [
        "Probability by block, with unknown effects: valve 91 %, process 1 %, sensor 7 %,"
        " disturbance 1 %.",
        "Gap: distance between record and simulations, in standard deviations between simulations.",
        "It is 4.00 with the model as given, 3.50 with K, T, Td refitted, 1.25 with the effect"
        " added.",
        "Repeatability floor: two simulations that differ only in their seeds are 0.80 apart.",
        "Of the gap above this floor, the effect removes 86 % (90 % interval 76 to 91 %).",
    ]
    assert max(map(len, lines[1:])) <= 100
    assert lines[12:14] == ["", "probability  effect"]
    assert lines[14] == "      0.914  stiction                S = 6.04, J = 3 % of travel"
    assert [line.split()[1] for line in lines[14:20]] == [
        "stiction",
        "none",
        *(f"effect_{i}" for i in range(4)),
    ]
    assert lines[20:] == ["", "Next test, bump: bump it.", "note: one", "note: two"]


def test_a_terminal_shows_what_cannot_be_distinguished_and_when_nothing_can_be_claimed():
    text = report(
        group=("deadband", "stiction"),
        gap=(1.0, 1.0, 1.0, 0.8, False, 0.8),
        value=None,
        blocks=dict.fromkeys(SHARES, 0.0),
    )
    lines = text.as_text().splitlines()
    assert lines[7] == "These effects give the same signals in this record: deadband, stiction."
    assert "The gap does not stand out of the floor, so no reduction is claimed." in lines
    assert not [line for line in lines if line.startswith(("Probability", "Of the gap"))]
    assert report(group=("stiction",)).as_text().count("the same signals") == 0


def test_only_known_effects_are_added_to_the_baseline():
    assert report().fixed_loop().valve.parameters == {"S": 6.04, "J": 3.0}
    assert report().fixed_loop().simulate(seed=1).record.n == 100
    unknown = {"block": "process", "effect": "unknown", "parameters": {}, "probability": 0.62}
    assert report("unknown", "process", (unknown,)).fixed_loop() == LOOP


def test_a_table_and_a_picture_hold_the_ranking():
    frame = report().to_frame()
    assert frame["parameters"].tolist()[:2] == ["S = 6.04, J = 3 % of travel", ""]
    assert frame["gap_after"].tolist()[0] == 1.25
    axes = report().plot(2)
    assert [t.get_text() for t in axes.get_yticklabels()] == ["none", "stiction"]
    assert [p.get_width() for p in axes.patches] == [0.051, 0.914]
    assert axes.get_xlim() == (0.0, 1.0)
    assert len(report().plot().patches) == 6
    shown = report()._repr_html_()
    assert "The simulation lacks stiction" in shown
    assert "effect_4" in shown


def test_numbers_have_three_digits_and_words_no_underscores():
    assert (
        numbers("quantisation", {"step": 2.14159, "at": "record", "n": 3})
        == ", step = 2.14 PV units, at = record, n = 3"
    )
    assert numbers("stiction", {"S": 2.1, "J": 3.0}, "") == "S = 2.1, J = 3 % of travel"
    assert numbers("noise", {"factor": 2.0}) == ", factor = 2"
    assert numbers("none", {}) == numbers("none", {}, "with ") == ""
    assert words("gain_mismatch") == "gain mismatch"


def test_units_of_op_are_those_of_the_record():
    assert numbers("stiction", {"S": 2.0, "J": 1.0}, "") == "S = 2, J = 1 % of travel"
    assert numbers("stiction", {"S": 2.0}, "", "OP units") == "S = 2 OP units"
    assert numbers("load_drift", {"rate": 2.0}, "", "OP units") == "rate = 2 OP units/s"
    assert numbers("sensor_lag", {"tau": 2.0}, "", "OP units").endswith(" s")
