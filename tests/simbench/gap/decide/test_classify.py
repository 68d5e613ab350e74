"""From evidence to probabilities: they sum to one, have no unit, and every correction moves only what it should."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from scenarios.spec import Loop
from simbench.gap.decide import classify as module
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.classify import (
    Classified,
    by_gain,
    candidate_rows,
    classify,
    combined,
    probabilities,
    record_row,
)
from simbench.gap.decide.evidence import Row, evidence, squashed
from simbench.gap.intake.check import check
from simbench.gap.random_case import Case, random_case
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN

CASES = {
    name: replace(case, record=case.record.window(0, 800))
    for name, case in (("mv", random_case(8, ("oscillation",), mv=True)), ("blind", random_case(12, ("gain_mismatch",))))
}


TOLERANCE = 1e-3


def rescaled(case: Case, pv: float = 1.0, Ts: float = 1.0) -> tuple:
    """Return record and baseline in other units of PV and of time."""
    r, table = case.record, case.baseline.to_table()
    K = table["plant"]["K"]
    table["plant"] |= {"K": K * pv / (Ts if table["plant"]["type"] == "integrating" else 1.0), "Td": table["plant"]["Td"] * Ts}
    if "T" in table["plant"]:
        table["plant"]["T"] *= Ts
    table["controller"] |= {"Kc": table["controller"]["Kc"] / pv, "Ti": table["controller"]["Ti"] * Ts}
    table["operating_point"]["pv0"] *= pv
    table["setpoint"] = {"value": table["setpoint"]["value"] * pv, "steps": []}
    table["noise"] = {"std": table["noise"]["std"] * pv}
    table["sampling"]["Ts"] *= Ts
    assert r.sp is not None
    return replace(r, pv=r.pv * pv, sp=r.sp * pv, Ts=r.Ts * Ts), Loop.from_table(table)


@cache
def assessed(name: str) -> Assessment:
    return assess(check(CASES[name].record, CASES[name].baseline))


@pytest.fixture(params=list(CASES))
def found(request) -> Assessment:
    return assessed(request.param)


@pytest.fixture
def rows(found) -> dict[str, Row]:
    return evidence(found)


def test_probabilities_are_in_the_contracts_order_and_sum_to_one(found, rows):
    p = classify(found).probability
    assert list(p) == [*EFFECTS, NONE, UNKNOWN]
    assert sum(p.values()) == pytest.approx(1.0)
    assert min(p.values()) > 0.0
    assert probabilities([rows])[0] == pytest.approx(list(p.values()))


def test_records_are_weighed_apart_from_each_other(rows):
    other = {**rows, NONE: {}, "noise": {**rows["noise"], "gain": 5.0}}
    both = probabilities([rows, other])
    assert both.shape == (2, 24)
    assert np.allclose(both[0], probabilities([rows])[0])
    assert np.allclose(both[1], probabilities([other])[0])


@pytest.mark.parametrize(("name", "units"), [("mv", {"pv": 64.0}), ("mv", {"Ts": 4.0}), ("blind", {"pv": 0.25, "Ts": 0.5})])
def test_evidence_has_no_unit_of_pv_or_time(name, units):
    one, other = evidence(assessed(name)), evidence(assess(check(*rescaled(CASES[name], **units))))
    assert one.keys() == other.keys()
    for key, row in one.items():
        assert row.keys() == other[key].keys(), key
        for what, value in row.items():
            # rounding decides where a search along an idle parameter ends, no more; a unit left in would shift by its logarithm
            assert other[key][what] == pytest.approx(value, abs=TOLERANCE, rel=TOLERANCE), (key, what)


def test_missing_numbers_are_allowed(rows):
    bare = {"record": {}, **{e: {"gain": rows[e]["gain"]} for e in EFFECTS}}
    p = probabilities([bare])[0]
    assert np.all(np.isfinite(p))
    assert p.sum() == pytest.approx(1.0)


def test_numbers_the_trees_do_not_know_change_nothing(rows):
    more = {name: {**row, "phase of the moon": 0.3} for name, row in rows.items()}
    assert np.array_equal(probabilities([more]), probabilities([rows]))


def test_lines_hold_each_number_in_its_column():
    rows: dict[str, Row] = {"record": {"n": 7.0}, **{e: {"gain": float(i)} for i, e in enumerate(EFFECTS)}}
    rows["drift"] |= {"size": 4.0, "gain": 99.0}
    effects = list(EFFECTS)
    X = candidate_rows(rows, effects, ["n", "mv"], ["gain", "size"])
    drift = effects.index("drift")
    assert X.shape == (len(effects) + 1, 6)
    assert X[drift].tolist()[2:5] == [99.0, 4.0, 7.0]
    assert np.isnan(X[:, 5]).all()
    assert np.isnan(X[-1, 2:4]).all()
    line = record_row(rows, effects, ["n"], ["size"])
    assert line.tolist()[:3] == [drift, 4.0, 7.0]
    assert line.tolist()[3:] == [rows[e]["gain"] for e in EFFECTS]


def test_unknown_takes_its_share_from_all_alike():
    z = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 0.0]])
    p = combined(z, np.array([0.0, 3.0]), 2.0, 1.0, 0.0)
    assert p[0, -1] == 0.5
    assert p[1, -1] == pytest.approx(1 / (1 + np.exp(-3)))
    assert np.log(p[0, 1] / p[0, 0]) == pytest.approx(0.5)
    assert np.allclose(p.sum(axis=1), 1.0)


def test_nats_are_squashed_evenly_on_both_sides():
    assert squashed(0.0) == 0.0
    assert squashed(-20.0) == -squashed(20.0)
    assert squashed(20.0) == pytest.approx(np.log(21.0))


def test_where_the_baseline_was_identified_gains_decide(found, monkeypatch):
    loose = replace(found, situation=replace(found.situation, trusted=False), unexplained={})
    monkeypatch.setattr(module, "_models", None)  # the trees are not asked
    quiet = dict.fromkeys(EFFECTS, -3.0)
    p = classify(replace(loose, log_likelihood_gains={**quiet, "noise": 12.0}, chosen=["noise"])).probability
    assert max(p, key=lambda a: p[a]) == "noise"
    p = classify(replace(loose, log_likelihood_gains=quiet, chosen=[])).probability
    assert max(p, key=lambda a: p[a]) == NONE
    p = classify(replace(loose, log_likelihood_gains={**quiet, "noise": 12.0}, unexplained={"valve": "MV strays"})).probability
    assert max(p, key=lambda a: p[a]) == UNKNOWN
    # an effect as probable as none needs just the gain that stands for none
    q = by_gain(replace(loose, log_likelihood_gains={**quiet, "drift": module.NONE_GAIN}, chosen=[]))
    assert q["drift"] == pytest.approx(q[NONE])
    assert sum(q.values()) == pytest.approx(1.0)


def test_where_the_baseline_was_identified_a_second_effect_counts_though_alone_it_does_not(found):
    loose = replace(found, situation=replace(found.situation, trusted=False), unexplained={})
    gains = {**dict.fromkeys(EFFECTS, -3.0), "noise": 25.0, "drift": -2.0}
    one, two = (by_gain(replace(loose, log_likelihood_gains=gains, chosen=c)) for c in (["noise"], ["noise", "drift"]))
    assert two["drift"] > 100 * one["drift"]
    assert max(two, key=lambda e: two[e]) == "noise"


def test_unknown_stands_in_the_block_that_fails(found):
    assert classify(replace(found, unexplained={"valve": "MV strays", "sensor": "frozen"})).unknown_block == "valve"
    quiet = dict.fromkeys(found.tests, 0.0)
    assert classify(replace(found, unexplained={}, tests={**quiet, "bursts": 13.0})).unknown_block == "sensor"
    assert classify(replace(found, unexplained={}, tests=quiet, chosen=["drift"])).unknown_block == EFFECTS["drift"].block


def test_a_blocks_share_is_the_summed_probability_of_what_lies_in_it():
    p = dict.fromkeys((*EFFECTS, NONE, UNKNOWN), 0.0) | {
        "stiction": 0.3,
        "deadband": 0.2,
        "noise": 0.1,
        UNKNOWN: 0.2,
        NONE: 0.2,
    }
    shares = Classified(p, "process").shares
    assert shares == pytest.approx({"controller": 0.0, "valve": 0.625, "process": 0.25, "sensor": 0.125, "disturbance": 0.0})


def test_where_none_is_the_answer_no_block_has_a_share():
    p = dict.fromkeys((*EFFECTS, NONE, UNKNOWN), 0.0) | {"stiction": 0.4, NONE: 0.6}
    assert set(Classified(p, "process").shares.values()) == {0.0}


def test_an_effect_the_trees_never_saw_is_weighed_by_its_likelihood_against_all_others(found, monkeypatch):
    trees = module._models()
    plain = classify(found).probability
    learned = [e for e in trees[2]["effects"] if e != "error_deadband"]
    monkeypatch.setattr(module, "_models", lambda: (*trees[:2], {**trees[2], "effects": learned}))
    monkeypatch.setattr(module, "probabilities", lambda rows: np.array([[plain[e] for e in (*learned, NONE, UNKNOWN)]]))
    for gain, most in ((-10.0, 0.0), (500.0, 1.0)):
        p = classify(replace(found, log_likelihood_gains={**found.log_likelihood_gains, "error_deadband": gain})).probability
        assert sum(p.values()) == pytest.approx(1.0)
        assert p["error_deadband"] == pytest.approx(most, abs=0.1)
        if most == 0.0:
            assert p["stiction"] == pytest.approx(plain["stiction"], rel=0.1)
