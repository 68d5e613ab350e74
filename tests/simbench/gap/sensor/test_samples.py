"""Samples of PV: what the sensor or the archive did to them."""

import numpy as np
import pytest

from simbench.gap.sensor.samples import exception_band, inspect_samples
from simbench.loop.effects.compression import swinging_door


@pytest.mark.parametrize("begins", [0.0, 4.13])
@pytest.mark.parametrize("step", [0.5, 0.237, 3.3])
def test_a_lattice_shows_through_decimal_rounding_wherever_it_begins(step, begins):
    rng = np.random.default_rng(1)
    pv, op = begins + np.round(rng.normal(40, 5 * step, 800) / step) * step, rng.normal(50, 5, 800)
    # the other column shows that the file has digits to spare
    samples = inspect_samples(np.round(pv, 5), np.round(op, 5))
    assert samples.step == pytest.approx(step, rel=1e-3)
    assert samples.resolution == pytest.approx(1e-5)
    assert samples.straight == 0.0


def test_decimal_digits_are_no_lattice():
    samples = inspect_samples(np.round(np.random.default_rng(1).normal(40, 5, 800), 3))
    assert (samples.step, samples.resolution) == (0.0, pytest.approx(1e-3))


def test_straight_lines_are_seen_in_a_compressed_archive_only():
    rng = np.random.default_rng(0)
    pv = np.cumsum(rng.standard_normal(1500)) * 0.1 + 0.1 * rng.standard_normal(1500)
    assert inspect_samples(swinging_door(pv, 0.3)).straight > 0.3
    assert inspect_samples(pv).straight == 0.0


def test_spikes_and_standstills_are_reported_with_their_sizes():
    pv = np.random.default_rng(2).normal(0, 0.1, 1000)
    pv[[100, 300, 800]] += [2.0, -2.0, 3.0]
    pv[600:650] = pv[600]
    samples = inspect_samples(pv)
    assert samples.spikes.tolist() == [100, 300, 800]
    assert samples.heights == pytest.approx([2.0, -2.0, 3.0], abs=0.4)
    assert (samples.held, samples.stuck) == (50, pytest.approx(0.05))


def test_a_noise_with_heavy_tails_has_no_spikes():
    pv = 40 + np.random.default_rng(7).standard_t(4, 3000)
    assert inspect_samples(pv).spikes.size == 0


def archived_by_exception(x, band):
    out = np.array(x)
    for k in range(1, out.size):
        if abs(out[k] - out[k - 1]) <= band:
            out[k] = out[k - 1]
    return out


def test_an_archive_that_reports_by_exception_is_told_from_a_sensor_that_freezes():
    rng = np.random.default_rng(11)
    pv = 50.0 + np.convolve(rng.normal(0.0, 1.0, 1500), np.ones(8) / 8.0, "same")
    frozen = pv.copy()
    for start in range(100, 1400, 150):
        frozen[start : start + 60] = frozen[start]
    for unit in (0.0, 0.01):
        kept = archived_by_exception(pv, 0.3)
        shown = np.round(kept / unit) * unit if unit else kept
        assert exception_band(shown, unit) == pytest.approx(0.3, abs=0.02)
    for other, unit in ((pv, 0.0), (frozen, 0.0), (np.round(pv, 1), 0.1)):
        assert exception_band(other, unit) == 0.0


def test_an_archive_by_exception_that_also_stores_after_a_time_limit_is_still_one():
    pv = np.random.default_rng(12).normal(50.0, 1.0, 3000)
    kept = archived_by_exception(pv, 0.2)
    kept[1000] = kept[999] + 0.05
    assert exception_band(kept, 0.0) == pytest.approx(0.2, abs=0.01)


def test_a_rough_pv_that_freezes_is_stuck_in_an_archive_by_exception_too():
    pv = np.random.default_rng(13).normal(50.0, 1.0, 3000)
    assert inspect_samples(archived_by_exception(pv, 0.2)).stuck == 0.0
    for start in range(100, 2900, 200):
        pv[start : start + 40] = pv[start]
    assert inspect_samples(archived_by_exception(pv, 0.2)).stuck == pytest.approx(0.187, abs=0.03)


def test_a_lattice_behind_the_digits_is_no_band():
    # the step of a transmitter of 12 bits, archived with three decimals
    pv = np.random.default_rng(3).normal(40.0, 0.06, 1700)
    assert exception_band(np.round(np.round(pv / 0.00386) * 0.00386, 3), 1e-3) == 0.0
