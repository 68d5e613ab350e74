"""Straight lines between kept samples are counted; curves, noise and coarse steps have none."""

import numpy as np
import pytest

from simbench.detectors.signal.holds import on_line, straight

KEPT = np.random.default_rng(0).standard_normal(101)
DRAWN = np.interp(np.arange(1001), np.arange(0, 1001, 10), KEPT)


def test_lines_between_kept_samples_are_counted_and_the_kept_ones_lie_on_none():
    share, lines = straight(DRAWN)
    assert share == pytest.approx(0.9, abs=0.02)
    assert 90 < lines <= 100
    assert not on_line(DRAWN)[::10].any()


def test_a_curve_and_noise_have_none():
    assert straight(np.sin(np.arange(2000) / 40))[0] < 0.01
    assert straight(np.random.default_rng(0).standard_normal(2000)) == (0.0, 0)


def test_no_unit_of_the_signal_changes_the_answer():
    assert straight(-1e4 * DRAWN + 3e3) == straight(1e-3 * DRAWN) == straight(DRAWN)
