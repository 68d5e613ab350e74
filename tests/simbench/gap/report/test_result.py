"""The answer in words: one sentence, and what a terminal shows below it."""

from dataclasses import replace
from types import SimpleNamespace

from simbench.gap.closed_loop.remaining import Remaining
from simbench.gap.report.ranked import Gap, Ranked, numbers, words
from simbench.gap.report.result import GapReport
from simbench.gap.stiction.conclusion import Conclusion
from simbench.scenarios import spec
from simbench.theory.public_loop import Loop

LOOP = Loop(
    plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
    controller={"type": "PI", "Kc": 1, "Ti": 10},
    sampling={"Ts": 1, "n": 100},
)


def corrected(effects):
    """Return the loop, with stiction where that is among the effects."""
    sticky = {"valve": {"model": "choudhury", "S": 6.04, "J": 3.0}}
    return spec.Loop.from_table(LOOP.with_all(sticky if "stiction" in effects else {}).to_table())


LOOPS = SimpleNamespace(corrected=corrected, adds=bool, described=lambda effects: [])
DETAILS = SimpleNamespace(loops=LOOPS, shown=None)
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
    "sensor": 0.03,
    "disturbance": 0.006,
    "unknown": 0.04,
}

CONCLUSION = Conclusion("stiction", 0.9, "stiction", "friction explains it", "confirm on the valve")


def report(
    effect="stiction",
    block="valve",
    effects=(STUCK,),
    *,
    gap=(4.0, 3.5, 1.25, 0.8, True, 0.9),
    value=0.859,
    **more,
):
    shrinkage = None if value is None else {"value": value, "lo": value - 0.1, "hi": value + 0.05}
    given = {
        "group": ("stiction",),
        "ranking": RANKING,
        "remaining": (),
        "blocks": SHARES,
        "next_test": "bump it",
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


def ranked(effect, p, block="none"):
    return (Ranked(effect, block, p, None, None, {}), *RANKING)


def test_an_effect_is_named_with_its_probability_and_how_near_it_brings_the_simulation():
    lacks = "The simulation lacks stiction (0.91): S = 6.04, J = 3 % of travel"
    near = (
        "It is then 1.25 from the record (4.00 before; parts of the record are 0.90 apart)."
        " Near the record: yes."
    )
    assert report().sentence() == f"{lacks}. {near}"
    wider = report(value=-0.25, gap=(4.0, 3.5, 4.8, 0.8, True, 0.8))
    assert wider.nearness().endswith("apart). Near the record: no.")
    assert wider.as_json()["gap"]["near"] is False
    both = report(effects=(STUCK, COARSE)).answer()
    assert both == f"{lacks}; with it, quantisation: step = 0.3 PV units, at = record."


def test_what_is_not_likelier_than_not_is_not_said_to_be_lacking():
    open_ = {**STUCK, "probability": 0.45}
    answer = report(effects=(open_,), ranking=ranked("stiction", 0.45)).answer()
    assert answer.startswith("Nothing is likely; the likeliest is stiction (0.45): S = 6.04")


def test_an_unknown_effect_is_placed():
    something = {"block": "process", "effect": "unknown", "parameters": {}, "probability": 0.62}
    ranking = ranked("unknown", 0.62, "process")
    sentence = report("unknown", "process", (something,), value=None, ranking=ranking).sentence()
    assert sentence == (
        "No known effect explains what is missing (0.62; block: process). It is 1.25 from the"
        " record (parts of the record are 0.90 apart). Near the record: yes."
    )
    open_ = ranked("unknown", 0.32, "process")
    answer = report("unknown", "process", (something,), value=None, ranking=open_).answer()
    assert answer == (
        "Nothing is likely; the likeliest is that no known effect explains what is missing (0.32;"
        " block: process)."
    )


def test_none_is_an_answer():
    nothing = {"block": "none", "effect": "none", "parameters": {}, "probability": 0.9}
    ranking = ranked("none", 0.9)
    sentence = report("none", "none", (nothing,), value=None, ranking=ranking).sentence()
    assert sentence.startswith("No unmodelled effect is needed (0.90). It is 1.25 from the record")


def test_the_set_ends_where_its_answers_have_the_probability_that_holds_the_truth():
    def of(*shares):
        return report(
            ranking=tuple(
                Ranked(e, "valve", p, None, None, {})
                for e, p in zip(("stiction", "deadband", "none"), shares)
            )
        )

    assert of(0.98, 0.01, 0.01).set == ("stiction",)
    assert of(0.93, 0.06, 0.01).set == ("stiction", "deadband")
    assert of(0.6, 0.33, 0.07).as_json()["set"] == ["stiction", "deadband", "none"]


def test_three_of_the_differences_that_remain_are_put_into_words():
    left = tuple(
        Remaining(f"size {i} (PV units)", "sensor", 1.0 + i, (0.25, 0.5), 9.0 - i) for i in range(6)
    )
    text = report(remaining=left).as_text()
    assert "  sensor: size 0 (PV units) is 1, simulated 0.25 to 0.5\n" in text
    assert "size 2" in text
    assert "size 3" not in text
    assert "What remains" not in report().as_text()
    assert report(remaining=left).as_json()["remaining"][5] == {
        "feature": "size 5 (PV units)",
        "block": "sensor",
        "recorded": 6.0,
        "simulated": [0.25, 0.5],
        "distance": 4.0,
    }


def test_a_terminal_lists_no_answer_that_is_next_to_impossible():
    unlikely = Ranked("drift", "sensor", 0.004, None, None, {})
    assert "drift" not in report(ranking=(*RANKING[:2], unlikely)).as_text()


def test_a_terminal_shows_six_candidates_and_blocks_of_half_a_percent_and_more():
    lines = report().as_text().splitlines()
    assert lines[:2] == [report().answer(), report().nearness()]
    assert lines[2:8] == ["", "The valve:", *CONCLUSION.as_lines(), ""]
    assert lines[8:10] == [
        "Not excluded at 90 %: stiction, none. Of what is missing, by block: valve 0.91,"
        " process 0.01, sensor 0.03, disturbance 0.01, no known effect 0.04.",
        "",
    ]
    assert lines[10] == "probability  effect"
    assert lines[11] == "      0.914  stiction                S = 6.04, J = 3 % of travel"
    assert [line.split()[1] for line in lines[11:17]] == [
        "stiction",
        "none",
        *(f"effect_{i}" for i in range(4)),
    ]
    assert lines[17:] == [
        "",
        "The distance of record and simulations is the mean over features, in standard deviations"
        " between simulations."
        " It is 3.50 with K, T and Td fitted again and nothing added; simulations that differ only"
        " in their seeds are 0.80 apart (the floor)."
        " Of the gap above the floor, the effect removes 86 % (90 % interval 76 to 91 %).",
        "Next: bump it.",
        "note: one",
        "note: two",
    ]


def test_the_next_test_is_said_once():
    once = report(conclusion=replace(CONCLUSION, next="bump it")).as_text()
    assert once.count("bump it") == 1


def test_every_gap_is_printed_once():
    text = report(gap=(4.11, 3.52, 1.23, 0.84, True, 0.95)).as_text()
    assert [text.count(size) for size in ("4.11", "3.52", "1.23", "0.84", "0.95")] == [1] * 5


def test_a_terminal_shows_what_cannot_be_distinguished_and_when_nothing_can_be_claimed():
    ranking = (*RANKING[:1], Ranked("deadband", "valve", 0.03, None, None, {}), *RANKING[1:])
    text = report(
        group=("deadband", "stiction"),
        gap=(1.0, 1.0, 1.0, 0.8, False, 0.8),
        value=None,
        blocks=dict.fromkeys(SHARES, 0.0),
        ranking=ranking,
    )
    told = text.as_text()
    assert "Not told apart by this record: deadband, stiction (0.94 together)." in told
    assert "The gap does not stand out of the floor, so no reduction is claimed." in told
    assert "by block" not in told
    assert "Of the gap" not in told
    assert report(group=("stiction",)).as_text().count("Not told apart") == 0
    wider = report(value=-0.25).gap_lines()[-1]
    assert wider.endswith("the effect does not remove any (90 % interval -35 to -20 %).")


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
