"""Spikes: found on slopes, side by side and in noise; corners, steps and bursts of noise are
none.
"""

import numpy as np
import pytest

from simbench.detectors.signal.spikes import cleaned, find_spikes, off_line, touching

T = np.arange(1200.0)
CORNERS = np.interp(T, [0, 300, 400, 800, 830, 1200], [0, 0, 30, 30, 5, 5])


def test_spikes_are_counted_with_their_heights_and_steps_are_not():
    pv = np.random.default_rng(2).normal(0, 0.1, 1000)
    pv[500:] += 5.0
    assert find_spikes(pv)[0].size == 0
    pv[[100, 300, 800]] += [2.0, -2.0, 3.0]
    places, heights = find_spikes(pv)
    assert places.tolist() == [100, 300, 800]
    assert heights == pytest.approx([2.0, -2.0, 3.0], abs=0.4)


def test_one_step_of_a_coarse_signal_is_no_spike():
    pv = np.round(np.random.default_rng(0).normal(0.0, 0.2, 2000))
    assert 5 < np.count_nonzero(pv) < 40
    assert find_spikes(pv, 1.0)[0].size == 0
    assert find_spikes(pv, 0.0)[0].size > 5


def test_a_record_of_a_few_samples_has_none():
    assert find_spikes(np.array([0.0] * 9 + [9.0] + [0.0] * 9))[0].size == 0


def test_cleaning_puts_the_line_between_the_neighbours_in_their_place():
    pv = CORNERS.copy()
    pv[[10, 350, 351]] += 7.0
    assert cleaned(pv, np.array([10, 350, 351])) == pytest.approx(CORNERS)
    assert cleaned(pv, np.empty(0, dtype=int)) is pv


def touching_one_after_the_other(x, least):
    """Slow twin of `touching`: a line through the neighbours of one pair at a time."""
    out = {}
    for k in np.flatnonzero(np.abs(off_line(x)[0]) > least).tolist():
        for apart in (1, 2):
            both = [k, k + apart]
            about = [j for j in range(k - 2, k + apart + 3) if j not in both]
            if about[0] < 0 or about[-1] >= x.size or out.keys() & {*about, *both}:
                continue
            line = np.polyfit(about, x[about], 1)
            heights = x[both] - np.polyval(line, both)
            spread = np.ptp(x[about] - np.polyval(line, about))
            if (np.abs(heights) > np.maximum(least[both], 2.0 * spread)).all():
                out |= dict(zip(both, heights.tolist(), strict=True))
    return out


@pytest.mark.parametrize("seed", range(20))
def test_touching_spikes_are_those_that_are_found_one_after_the_other(seed):
    rng = np.random.default_rng(seed)
    x = CORNERS + 0.1 * rng.standard_normal(T.size)
    first = rng.choice(T.size - 6, 25, replace=False)
    for k, apart in zip(first, rng.integers(1, 4, 25), strict=True):
        x[[k, k + apart]] += rng.choice([-1.0, 1.0], 2) * rng.uniform(0.5, 4.0, 2)
    least = np.full(T.size, rng.uniform(0.3, 1.0))
    found, expected = touching(x, least), touching_one_after_the_other(x, least)
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert len(found) > 4
