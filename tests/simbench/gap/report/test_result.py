"""The set of answers, the corrected loop, and what is said where nothing can be claimed."""

from types import SimpleNamespace

from simbench.gap.report.ranked import Gap, Ranked, numbers
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


def test_units_of_op_are_those_of_the_record():
    assert numbers("stiction", {"S": 2.0, "J": 1.0}, "") == "S = 2, J = 1 % of travel"
    assert numbers("stiction", {"S": 2.0}, "", "OP units") == "S = 2 OP units"
    assert numbers("load_drift", {"rate": 2.0}, "", "OP units") == "rate = 2 OP units/s"
    assert numbers("sensor_lag", {"tau": 2.0}, "", "OP units").endswith(" s")
