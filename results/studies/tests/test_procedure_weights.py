"""Weights of the procedure point the way the indices do."""

import numpy as np

from results.studies.procedure_weights import fit


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
