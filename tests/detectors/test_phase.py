"""Phase between two oscillations: one where they are locked, near nothing where they are not."""

import numpy as np
import pytest

from simbench.detectors.signal.filters import coherence, phase_locking

T = np.arange(4000.0)
SINE = np.sin(2 * np.pi * T / 40)


def test_locked_signals_keep_one_phase_and_independent_ones_none():
    wander = np.cumsum(np.random.default_rng(1).standard_normal(T.size)) / 5
    assert phase_locking(SINE, np.cos(2 * np.pi * T / 40 + 0.4), 40.0) == pytest.approx(1.0)
    assert phase_locking(SINE, np.sin(2 * np.pi * T / 40 + wander), 40.0) < 0.5
    assert coherence(SINE, 40.0) == pytest.approx(1.0, abs=1e-3)


def test_the_ends_of_a_record_are_not_judged():
    ends = (T < 0.08 * T.size) | (T >= 0.92 * T.size)
    other = np.where(ends, -SINE, SINE)
    assert phase_locking(SINE, other, 40.0) > 0.99
    assert coherence(other, 40.0) > 0.99
