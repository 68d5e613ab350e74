"""What the calibration of the probability is judged on: loops of both labels, factors that other
grids teach, and the cost of answers.
"""

import numpy as np
import pytest

from results.studies.plant import calibration as study


def row(gain, sticky, share=0.3, cycles=30.0, pace=30.0, **rules):
    return {"sticky": sticky, "evidence": [gain, share, cycles, pace], **rules}


def test_half_of_the_loops_that_are_drawn_cycle_by_friction():
    ids = study.chosen("ci", 20, seed=3)
    assert sum(ids.values()) == 10
    assert ids == study.chosen("ci", 20, seed=3)
    assert set(ids) != set(study.chosen("ci", 20, seed=4))


def test_factors_follow_what_the_labels_of_other_grids_say():
    rng = np.random.default_rng(1)
    gains = rng.uniform(-10.0, 30.0, 60)
    sound = [row(g, False) for g in gains] + [row(200.0, True) for _ in gains]
    mixed = [row(g, i % 2 == 0) for i, g in enumerate(gains)] + [row(200.0, True)]
    assert study.learned([sound])[0] > 1.5 > study.learned([mixed])[0]


def test_an_error_costs_twice_what_no_decision_does():
    y = np.array([True, True, False, False])
    said = study.line("some", np.array([0.1, 0.5, 0.9, 0.1]), y)
    denied, open_, claimed, left, cost, *_ = (float(x) for x in said.split()[1:])
    assert (denied, open_, claimed, left) == (0.5, 0.5, 0.5, 0.0)
    assert cost == pytest.approx((1.0 + 0.5 + 1.0) / 4)
