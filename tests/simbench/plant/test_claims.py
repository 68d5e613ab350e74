"""Claims are held against what was measured, loop by loop."""

import pytest

from simbench.plant import claims
from simbench.plant.learn import LEARNING, TESTING, fit, loops


def row(sticky, probability, verdict, visible):
    power = [{"S": s, "J": s, "found": f} for s, f in ((1.0, 0.0), (4.0, 1.0))]
    method = {"method": "he", "verdict": verdict, "false_alarms": 0.1, "power": power}
    seen = None if visible is None else {"S": visible, "J": visible}
    answer = {"methods": [method], "best": "he", "probability": probability, "smallest_visible": seen}
    return {"sticky": sticky, "answer": answer}


def true(S, healthy, sticky):
    return {"S": S, "J": S, "healthy": {"he": healthy}, "sticky": None if sticky is None else {"he": sticky}}


PAIRS = [
    (row(True, 0.9, "stiction", 2.0), true(4.5, 0.2, 1.0)),
    (row(True, 0.4, "no_stiction", 2.0), true(0.5, 0.0, 0.1)),
    (row(False, 0.1, "no_stiction", None), true(0.0, 0.0, None)),
]


def test_the_cell_nearest_to_the_truth_is_what_was_claimed():
    lines = claims._claims(PAIRS, ["he"])
    name, alarms, measured, _, power, found, off = lines[-1].split()
    assert (name, alarms, measured) == ("he", "0.10", "0.07")
    assert (power, found) == ("0.50", "0.55")
    assert float(off) == pytest.approx(0.05)


def test_only_small_friction_is_said_to_be_invisible():
    assert "1 of 1 buried" in claims._visible(PAIRS)[1]
    assert "0 of 1 plainly visible" in claims._visible(PAIRS)[2]


def test_an_abstention_is_not_right():
    assert not claims._right("no_decision", True)
    assert not claims._right("no_decision", False)


def test_loops_learned_on_are_never_tested_on():
    learned = {s.tags["cell"] for s in loops(6, LEARNING)}
    tested = {s.tags["cell"] for s in loops(6, TESTING)}
    assert learned
    assert not learned & tested


def test_a_calibration_learned_on_telling_evidence_believes_it():
    rows = [{"sticky": i % 2 == 0, "of_twins": 0.8 if i % 2 == 0 else 0.3, "gain": 5.0 * (-1) ** i} for i in range(40)]
    rows += [{"sticky": i % 2 == 1, "of_twins": 0.5, "gain": None} for i in range(10)]
    found = fit(rows)
    assert found.probability(0.8, 5.0) > 0.8
    assert found.probability(0.3, -5.0) < 0.2
    assert found.loops == 50
