"""Straight lines between kept samples are counted; curves, noise and coarse steps have none."""

import numpy as np
import pytest

from simbench.detectors.signal.lines import on_line, share_on_lines, straight

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


def test_lines_between_samples_kept_are_seen_in_few_digits_where_the_noise_is_known():
    rng = np.random.default_rng(7)
    noisy = 5.0 + 0.1 * rng.standard_normal(3000)
    k = np.arange(noisy.size)
    drawn = np.round(np.interp(k, k[::12], noisy[::12]), 2)
    assert share_on_lines(drawn, 0.01) == 0.0
    assert share_on_lines(drawn, 0.01, 0.1) > 0.6
    assert share_on_lines(np.round(noisy, 2), 0.01, 0.1) < 0.04
    # nor does a sensor stand still for being written in few digits
    still = np.where(k < 1500, noisy, 5.0)
    assert share_on_lines(np.round(still, 2), 0.01, 0.1) < 0.04


def test_a_filtered_signal_written_in_few_digits_lies_on_lines_by_chance():
    # behind a lag the bends of the noise are no larger than the rounding, or a few times that
    white = 0.1 * np.random.default_rng(11).standard_normal(3000)
    smooth = white.copy()
    for pole in (0.8, 0.9, 0.94):
        for k in range(1, white.size):
            smooth[k] = pole * smooth[k - 1] + (1.0 - pole) * white[k]
        assert share_on_lines(np.round(smooth, 2), 0.01, 0.1) == 0.0
