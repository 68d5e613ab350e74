"""Weights of the procedure: the loops they come from, and the fit."""

import numpy as np

from detectors.evidence import EVIDENCE
from results.studies.procedure_weights import collect, fit


def test_indices_are_collected_for_both_kinds_of_process():
    found = collect("smoke", seed=5)
    assert set(found) == {False, True}
    for case, (x, y) in found.items():
        assert x.shape == (y.size, len(EVIDENCE[case]))
        assert y.dtype == bool
        spans = np.array([[e.low - e.neutral, e.high - e.neutral] for e in EVIDENCE[case]])
        assert np.all((x >= spans[:, 0]) & (x <= spans[:, 1]))


def test_weights_point_the_way_the_indices_do():
    rng = np.random.default_rng(0)
    y = rng.random(400) < 0.3
    x = np.column_stack([rng.standard_normal(400) + y, rng.standard_normal(400), rng.standard_normal(400) - 2 * y])
    bias, weights = fit(x, y)
    assert weights[0] > 0.5
    assert abs(weights[1]) < 0.4
    assert weights[2] < -1.5
    # both labels count the same, however rare one of them is
    assert np.mean((x @ weights + bias > 0)[y]) > 0.75
