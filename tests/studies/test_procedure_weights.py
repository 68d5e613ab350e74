"""Weights of the procedure: the loops they come from, and the fit."""

import numpy as np

from detectors.evidence import EVIDENCE
from results.studies.procedure_weights import bound, collect, fit, main


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
    x = np.column_stack(
        [rng.standard_normal(400) + y, rng.standard_normal(400), rng.standard_normal(400) - 2 * y]
    )
    bias, weights = fit(x, y)
    assert weights[0] > 0.5
    assert abs(weights[1]) < 0.4
    assert weights[2] < -1.5
    # both labels count the same, however rare one of them is
    assert np.mean((x @ weights + bias > 0)[y]) > 0.75


def test_the_bound_is_the_one_with_the_fewest_errors_whatever_the_share_of_sticky_loops():
    rng = np.random.default_rng(1)
    y = np.arange(4000) % 5 == 0
    score = rng.standard_normal(4000) + 2.0 * y
    score[::100] = np.nan  # no decision
    at, wrong = bound(score, y)
    assert abs(at - 1.0) < 0.25
    assert abs(wrong - 0.159) < 0.02


def test_bounds_are_printed_for_the_methods_that_are_named(capsys):
    assert main(["--grid", "smoke", "--every", "4", "--bounds", "hammerstein"]) == 0
    assert capsys.readouterr().out.startswith("hammerstein: ")
