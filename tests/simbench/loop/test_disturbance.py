"""Coloured loads: the size and the memory that the loop file states."""

import numpy as np
import pytest
from scipy.signal import welch

from simbench.loop.disturbance import DISTURBANCES, disturbance_signal
from simbench.scenarios.parts import Part


def coloured(n=200_000, Ts=1.0, seed=0, **parameters):
    return disturbance_signal(Part(name="coloured", parameters=parameters), n, Ts, (seed,))[1]


@pytest.mark.parametrize(
    ("period", "lag"), [(20.0, 0.0), (20.0, 5.0), (12.0, 12.0), (4.0, 15.0), (20.0, 0.1)]
)
@pytest.mark.parametrize("Ts", [1.0, 0.25])
def test_standard_deviation_is_the_amplitude_with_and_without_lag(period, lag, Ts):
    assert np.std(coloured(Ts=Ts, amplitude=2.0, period=period, lag=lag)) == pytest.approx(
        2.0, rel=0.06
    )


def test_a_vanishing_lag_changes_nothing():
    assert np.allclose(
        coloured(n=500, amplitude=2.0, period=20.0, lag=1e-3),
        coloured(n=500, amplitude=2.0, period=20.0),
    )


@pytest.mark.parametrize(("lag", "power"), [(0.0, 2.0), (10.0, 4.0)])
def test_power_falls_with_the_second_power_of_frequency_or_with_lag_the_fourth(lag, power):
    # corners at 1/(2 pi 10 s) and 1/(2 pi 20 s): beyond both and far below the sampling's end
    f, p = welch(coloured(Ts=0.2, amplitude=1.0, period=20.0, lag=lag), fs=5.0, nperseg=4096)
    band = (f > 0.08) & (f < 0.4)
    assert -np.polyfit(np.log(f[band]), np.log(p[band]), 1)[0] == pytest.approx(power, abs=0.25)
    low = (f > 0) & (f < 0.003)
    assert p[low].mean() > 20 * p[band].mean()


@pytest.mark.parametrize("kind", DISTURBANCES)
def test_a_longer_signal_begins_with_the_same_bits(kind):
    more = {"jitter": 0.3} if kind in ("sine", "propagated") else {}
    load = Part(name=kind, parameters={"amplitude": 2.0, "period": 30.0, "start": 7.0, **more})
    short, long = (disturbance_signal(load, n, 1.0, (5, 100))[1] for n in (400, 900))
    assert np.array_equal(short, long[:400])
    assert np.ptp(short) > 0.0
    assert disturbance_signal(load, 400, 1.0, (5, 100))[1] is short
