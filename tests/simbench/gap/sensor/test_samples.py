"""Single samples: lattices, spikes and straight lines are found, and what only looks like them is not."""

import numpy as np
import pytest

from simbench.gap.sensor.samples import heavy_tails, hides_nothing, inspect_samples, lattice
from simbench.loop.effects.compression import swinging_door


@pytest.mark.parametrize("step", [0.5, 0.237, 3.3])
def test_a_lattice_is_found_through_decimal_rounding(step):
    rng = np.random.default_rng(1)
    pv, op = np.round(rng.normal(40, 5, 800) / step) * step, rng.normal(50, 5, 800)
    # the other column shows that the file has digits to spare
    assert inspect_samples(np.round(pv, 5), np.round(op, 5)).step == pytest.approx(step, rel=1e-3)


def test_decimal_digits_are_no_lattice():
    pv = np.round(np.random.default_rng(1).normal(40, 5, 800), 3)
    assert inspect_samples(pv).step == 0.0


def test_spikes_are_counted_and_steps_are_not():
    rng = np.random.default_rng(2)
    pv = rng.normal(0, 0.1, 1000)
    pv[500:] += 5.0
    assert inspect_samples(pv).spikes.size == 0
    pv[[100, 300, 800]] += [2.0, -2.0, 3.0]
    assert inspect_samples(pv).spikes.tolist() == [100, 300, 800]


def test_straight_lines_are_seen_in_a_compressed_archive_only():
    rng = np.random.default_rng(0)
    pv = np.cumsum(rng.standard_normal(1500)) * 0.1 + 0.1 * rng.standard_normal(1500)
    assert inspect_samples(swinging_door(pv, 0.3)).straight > 0.3
    assert inspect_samples(pv).straight == 0.0


def test_spikes_on_a_slope_and_side_by_side_are_found_and_corners_are_not():
    rng = np.random.default_rng(3)
    t = np.arange(1200.0)
    smooth = np.interp(t, [0, 300, 400, 800, 830, 1200], [0, 0, 30, 30, 5, 5])
    pv = smooth + 0.02 * rng.standard_normal(t.size)
    assert inspect_samples(pv).spikes.size == 0
    places = np.array([100, 320, 350, 351, 600, 602, 815, 1000])
    pv[places] += 2.0 * rng.choice([-1.0, 1.0], places.size)
    assert inspect_samples(pv).spikes.tolist() == places.tolist()


def test_bursts_of_noise_are_no_spikes():
    rng = np.random.default_rng(6)
    noise = rng.standard_normal(3000)
    for k in range(100, 3000, 300):
        noise[k : k + 60] *= 6.0
    assert inspect_samples(noise).spikes.size == 0


@pytest.mark.parametrize("start", [0.0, 0.11, 7.003])
@pytest.mark.parametrize("archive", [0.0, 0.006])
def test_a_lattice_is_found_wherever_it_begins_and_on_whatever_finer_one_it_was_written(start, archive):
    x = start + 0.17 * np.round(np.random.default_rng(3).normal(300, 20, 1500))
    if archive:
        x = archive * np.round(x / archive)
    assert lattice(x, 1e-6) == pytest.approx(0.17, rel=1e-3)


def test_values_that_lie_anywhere_are_on_no_lattice():
    rng = np.random.default_rng(4)
    for digits in (2, 3, 9):
        for n in (100, 1000, 4000):
            x = np.round(rng.normal(40, 5, n), digits)
            assert lattice(x, 10.0**-digits if digits < 9 else 0.0) == 0.0, (digits, n)


def test_rounding_is_weighed_against_the_moves_it_hides():
    x = np.random.default_rng(5).normal(0, 1, 5000)
    # step^2/12 over the variance of the changes, 2
    assert hides_nothing(0.3, x)
    assert not hides_nothing(0.4, x)


def test_heavy_tails_are_told_from_gaussian_noise_with_spikes():
    rng = np.random.default_rng(6)
    heavy = [rng.standard_t(df, 2000) for df in (3, 4, 5)]
    spiked = []
    for rate in (0.004, 0.02):
        x = rng.normal(0, 1, 2000)
        hit = rng.random(2000) < rate
        x[hit] += rng.choice([-9, 9], hit.sum())
        spiked.append(x)
    assert all(heavy_tails(x) for x in heavy)
    assert not any(heavy_tails(x) for x in spiked)
    assert not heavy_tails(np.zeros(100))


def test_a_noise_with_heavy_tails_has_no_spikes():
    pv = 40 + np.random.default_rng(7).standard_t(4, 3000)
    found = inspect_samples(pv)
    assert found.heavy
    assert found.spikes.size == 0
