"""Samples of PV: what the sensor or the archive did to them."""

import numpy as np
import pytest

from simbench.gap.sensor.samples import exception_band, inspect_samples


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


def test_a_lattice_behind_the_digits_is_no_band():
    # the step of a transmitter of 12 bits, archived with three decimals
    pv = np.random.default_rng(3).normal(40.0, 0.06, 1700)
    assert exception_band(np.round(np.round(pv / 0.00386) * 0.00386, 3), 1e-3) == 0.0
