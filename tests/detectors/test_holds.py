"""Holds: runs of equal samples, and standstills that no chance brings."""

import numpy as np
import pytest

from simbench.detectors.signal.holds import runs_of, stuck


def test_standstills_are_distinguished_from_rounding():
    x = np.random.default_rng(1).standard_normal(2000)
    assert stuck(x) == 0.0
    for unit in (0.01, 0.1, 0.5):
        assert stuck(np.round(x / unit) * unit, unit) == 0.0
    x[400:440] = x[400]
    assert stuck(x) == pytest.approx(0.02)
    assert stuck(np.round(x, 2), 0.01) == pytest.approx(0.02, abs=0.001)


def test_a_signal_that_mostly_stands_tells_nothing():
    assert stuck(np.repeat(np.random.default_rng(1).standard_normal(40), 50)) == 0.0


def test_runs_have_their_begin_and_their_end():
    assert runs_of(np.array([False, True, True, False, True])).tolist() == [[1, 3], [4, 5]]
