"""Surrogates: what they keep, the prediction error against its plain twin, and where the index
stays.
"""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from simbench.detectors.compiled import compiled
from simbench.detectors.errors import ParameterError
from simbench.detectors.signal import surrogates
from simbench.detectors.signal.surrogates import (
    iaaft,
    nonlinearity_index,
    prediction_error,
    ranked_again,
)


def test_values_are_kept_exactly_and_the_spectrum_nearly():
    x = np.sin(np.arange(400) / 5) + 0.3 * np.random.default_rng(0).standard_normal(400)
    wanted = np.abs(np.fft.rfft(x - x.mean()))
    for y in iaaft(x, 5, np.random.default_rng(1)):
        assert np.array_equal(np.sort(y), np.sort(x))
        assert np.linalg.norm(np.abs(np.fft.rfft(y - y.mean())) - wanted) < 0.1 * np.linalg.norm(
            wanted
        )
        assert abs(np.corrcoef(x, y)[0, 1]) < 0.999


@pytest.mark.parametrize("run", [ranked_again, compiled(ranked_again)])
def test_ranks_from_an_earlier_order_equal_those_of_a_sort(run):
    rng = np.random.default_rng(2)
    y, values = rng.standard_normal((4, 60)), np.sort(rng.standard_normal(60))
    for order in (np.argsort(y + 0.1 * rng.standard_normal(y.shape), axis=1), np.argsort(-y)):
        ranked, wanted = np.empty_like(y), np.empty_like(y)
        run(y, order, values, ranked)
        np.put_along_axis(wanted, np.argsort(y, axis=1), values[None], axis=1)
        assert np.array_equal(ranked, wanted)
        assert np.array_equal(order, np.argsort(y, axis=1))


def by_tree(x, E, H, k):
    """The same by a k-d tree, which reaches far enough to leave overlapping pieces out."""
    pieces = np.lib.stride_tricks.sliding_window_view(x[:-H], E)
    future, m = x[E - 1 + H :], len(pieces)
    _, near = cKDTree(pieces).query(pieces, k=min(k + 2 * E - 1, m))
    apart = np.abs(near - np.arange(m)[:, None]) >= E
    first = apart & (np.cumsum(apart, axis=1) <= k)
    count, guess = first.sum(axis=1), np.where(first, future[near], 0.0).sum(axis=1)
    return float(np.sum((future - guess / count)[count > 0] ** 2))


@pytest.mark.parametrize(
    ("n", "E", "H", "k"), [(200, 10, 10, 8), (151, 7, 3, 1), (97, 12, 20, 5), (40, 8, 8, 8)]
)
def test_prediction_error_equals_that_of_a_tree(n, E, H, k):
    x = np.sin(np.arange(n) / 3) + 0.2 * np.random.default_rng(n).standard_normal(n)
    assert prediction_error(x, E, H, k) == pytest.approx(by_tree(x, E, H, k), rel=1e-12)


def test_plain_kernel_equals_the_compiled_one_bit_for_bit():
    x = np.random.default_rng(4).standard_normal(70)
    assert surrogates.prediction_errors(x, 5, 3, 4) == prediction_error(x, 5, 3, 4)


def test_look_alikes_equally_far_all_count():
    x = np.tile([0.0, 1.0, 0.0, -1.0], 30)
    assert prediction_error(x, 4, 4) == 0.0
    with pytest.raises(ParameterError, match="at least 1"):
        prediction_error(x, 4, 4, 0)


def test_a_noisy_sine_is_not_called_nonlinear():
    t = np.arange(4000)
    for seed in range(5):
        x = np.sin(2 * np.pi * t / 37.3) + 0.2 * np.random.default_rng(seed).standard_normal(t.size)
        assert nonlinearity_index(x, 37.3).npi < 1
