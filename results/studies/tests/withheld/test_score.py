"""The blind check's scoring, on answers made by hand."""

import pandas as pd
import pytest

from results.studies.withheld.claims import true_shrinkages
from results.studies.withheld.levels import calibration, levels
from results.studies.withheld.score import claimed_shrinkage, judge_record
from results.studies.worlds import own
from simbench.loop.effects import EFFECTS
from simbench.loop.effects._alike import Circumstances

FACTS = Circumstances(sp_moves=True)
GAP = {"before": 3.0, "recalibrated": 2.5, "after": 1.0, "floor": 1.0, "resolvable": True}


def answering(*effects, probability=1.0, parameters=None, shrinkage=0.9, others=()):
    """An answer in the contract's JSON that names `effects`, ranking `others` after them."""
    ranked = [(e, probability - 0.01 * i, 1.2) for i, e in enumerate(effects)]
    ranked += [(e, (1 - probability) / 9, 2.8) for e in others]
    ranking = [
        {
            "effect": e,
            "block": EFFECTS[e].block if e in EFFECTS else e,
            "probability": p,
            "gap_before": 3.0,
            "gap_after": after,
            "parameters": (parameters or {}) if e in effects else {},
        }
        for e, p, after in ranked
    ]
    return {
        "block": ranking[0]["block"],
        "effect": effects[0],
        "effects": ranking[: len(effects)] if effects[0] in EFFECTS else [],
        "group": [effects[0]],
        "ranking": ranking,
        "gap": GAP,
        "shrinkage": {"value": shrinkage, "lo": 0.5, "hi": 1.0},
    }


def truth_rows():
    rows = [
        {"id": f"{e}-{s}", "block": k.block, "effect": e, "strength": s, "ratio": "3.0",
         "shrinkage": str(0.5 + 0.02 * i), "parameters": {}}
        for i, (e, k) in enumerate(EFFECTS.items())
        for s in ("weak", "medium", "strong")
    ]  # fmt: skip
    rows += [{"id": f"none-{i}", "block": "none", "effect": "none"} for i in range(10)]
    two = {"id": "two", "block": "valve", "effect": "stiction", "strength": "strong"}
    rows.append(two | {"block2": "sensor", "effect2": "noise"})
    strange = {"block": "sensor", "effect": "unknown", "foreign": "frozen"}
    rows.append(strange | {"id": "f1", "strength": "strong", "ratio": "5"})
    return [*rows, strange | {"id": "f2", "strength": "weak", "ratio": "1.4"}]


def table_of(answerer):
    return pd.DataFrame([judge_record(row, answerer(row), FACTS) for row in truth_rows()])


def figures_of(table):
    return {f.name: f for f in levels(table)}


def held_of(figures):
    levelled = {n: f for n, f in figures.items() if f.level is not None and f.value is not None}
    return {name for name, f in levelled.items() if f.holds}, set(levelled)


def test_perfect_answers_hold_every_level():
    def right(row):
        if row["effect"] == "none":
            return answering("none")
        if row["id"] == "two":
            return answering("stiction", "noise")
        wrong = [e for e in ("deadband", "drift") if e != row["effect"]]
        shrinkage = float(row.get("shrinkage") or 0.9)
        return answering(row["effect"], shrinkage=shrinkage, others=wrong)

    figures = figures_of(table_of(right))
    assert figures["first answer right"].n == 2 * len(EFFECTS)  # weak records do not count
    held, levelled = held_of(figures)
    assert len(levelled) >= 12
    assert held == levelled
    assert figures["two effects: both among the first three"].value == 1.0
    assert (
        figures["foreign: unknown or the library's name, of the resolvable"].n == 1
    )  # the weak one is below 1.5


def test_answers_that_are_all_wrong_hold_none():
    def wrong(row):
        if row["effect"] == "unknown":
            return answering("noise")
        name = "compression" if row["effect"] != "compression" else "op_quantisation"
        return answering(name, probability=0.99)

    figures = figures_of(table_of(wrong))
    # it is never unknown, and that level is met by silence
    assert held_of(figures)[0] <= {
        "known effect called unknown",
        "parameters of the right effect, median error",
        "claimed shrinkage of the true group, median",
    }
    assert figures["first answer right"].value == 0.0
    assert figures["expected calibration error"].value > 0.9
    assert figures["effect named where there is none"].value == 1.0


def test_an_effect_nobody_knows_is_foreign_and_wants_unknown():
    truth = {"id": "a", "block": "valve", "effect": "positioner_hunting"}
    assert judge_record(truth, answering("unknown"), FACTS)["first"]
    row = judge_record(truth, answering("stiction"), FACTS)
    assert not row["first"]
    assert row["block_right"]
    assert row["kind"] == "foreign"


@pytest.mark.parametrize(
    ("named", "first", "block_right"),
    [
        ("unknown", True, True),
        ("slew_limit", True, True),
        ("valve_lag", False, True),
        ("frozen_sensor", False, False),
        ("none", False, False),
    ],
)
@pytest.mark.parametrize("called", ["slew_limit", "stroke_speed_limit"])  # as a world calls it
def test_a_foreign_kind_that_the_library_has_by_now_may_be_called_by_its_name(
    named, first, block_right, called
):
    truth = {"id": "a", "block": "valve", "effect": "unknown", "foreign": called}
    answer = answering(named) | ({"block": "valve"} if named == "unknown" else {})
    row = judge_record(truth | {"strength": "strong", "ratio": "5"}, answer, FACTS)
    assert (row["kind"], row["foreign"], row["effect"]) == ("foreign", called, "unknown")
    assert (row["first"], row["in_group"], row["block_right"]) == (first, first, block_right)
    assert row["top3"] == row["top3_group"] == first
    assert row["called_unknown"] == (named == "unknown")
    assert (
        figures_of(pd.DataFrame([row]))[
            "foreign: unknown or the library's name, of the resolvable"
        ].k
        == first
    )


def test_claimed_shrinkage_needs_a_resolvable_gap():
    candidate = {"gap_before": 3.0, "gap_after": 1.5}
    assert claimed_shrinkage(candidate, {"gap": GAP}) == pytest.approx(0.75)
    assert claimed_shrinkage({"gap_before": 3.0, "gap_after": 0.5}, {"gap": GAP}) == 1.0
    assert claimed_shrinkage(candidate, {"gap": GAP | {"resolvable": False}}) is None
    assert claimed_shrinkage({"gap_before": 3.0}, {"gap": GAP}) is None


@pytest.mark.parametrize(("probability", "error"), [(0.7, 0.0), (1.0, 0.3)])
def test_calibration_error_is_the_distance_of_confidence_and_success(probability, error):
    answer = answering("stiction", probability=probability)
    effects = ["stiction"] * 7 + ["noise"] * 3
    rows = [{"id": i, "block": "valve", "effect": e} for i, e in enumerate(effects)]
    table = pd.DataFrame([judge_record(r, answer, FACTS) for r in rows])
    assert calibration(table).value == pytest.approx(error, abs=1e-12)


def test_a_true_claim_closes_the_gap_when_simulated_again_and_a_false_one_does_not():
    entry = {"kind": "single", "effect": "gain_mismatch", "strength": "strong", "mv": False}
    item = own.draw(8, 0, entry | {"plant": "foptd"})
    answer = answering("gain_mismatch", parameters=item.answer["parameters"])
    false = {
        "effect": "compression",
        "probability": 0.1,
        "gap_before": 3.0,
        "gap_after": 1.0,
        "parameters": {"band": 1e-3 * item.answer["case"]["unit"]},
    }
    # what no world draws is passed over, also where it is the name of a foreign kind of this one
    strange = [
        false | {"effect": e, "parameters": dict(EFFECTS[e].identity)}
        for e in ("slew_limit", "derivative_action")
    ]
    answer["ranking"] += [*strange, false]
    record = pd.DataFrame(item.columns)
    rows = true_shrinkages(item.answer, answer, record, item.baseline, FACTS, "own")
    assert {r["effect"]: r["right"] for r in rows} == {"gain_mismatch": True, "compression": False}
    true = {r["effect"]: r["true"] for r in rows}
    # an interval is claimed of the named effect alone
    assert {r["effect"]: r["covered"] for r in rows}["compression"] is None
    for lo, covered in ((0.5, True), (1.1, False)):
        answer["effects"] = [{"effect": "gain_mismatch"}]
        answer["shrinkage"] = {"value": 0.9, "lo": lo, "hi": 1.2}
        again = true_shrinkages(item.answer, answer, record, item.baseline, FACTS, "own")
        assert {r["effect"]: r["covered"] for r in again}["gain_mismatch"] is covered
    assert true["gain_mismatch"] > 0.7
    assert true["compression"] < 0.3
    assert item.baseline["plant"]["K"] == item.answer["case"]["nominal"][0]
