"""The filter gives scipy's bits; scipy.signal is its slow-loading twin."""

import numpy as np
import pytest
from scipy import signal

from simbench.detectors.signal.filters import lfilter


@pytest.mark.parametrize(
    ("b", "a"),
    [
        ([1.0], [1.0, -0.97]),
        ([0.03], [1.0, -0.97]),
        ([0.2, 0.1], [2.0, -1.5]),
        ([0.0, 0.0, 0.4], [1.0, -1.2, 0.5, -0.01]),
    ],
)
def test_the_bits_are_scipys(b, a):
    x = np.random.default_rng(3).standard_normal(2000)
    assert np.array_equal(lfilter(b, a, x), signal.lfilter(b, a, x))


def test_a_state_from_before_counts():
    x = np.random.default_rng(3).standard_normal(50)
    assert np.array_equal(
        lfilter([0.1], [1.0, -0.9], x, 2.0), signal.lfilter([0.1], [1.0, -0.9], x, zi=[2.0])[0]
    )
