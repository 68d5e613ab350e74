"""Loads with corners: their period, size and shape."""

import numpy as np
import pytest

from results.studies.plant.corners import CUTS, under_wave, with_cut
from simbench.bench.scenario.resolve import resolve
from simbench.loop.echo import donor_of
from simbench.loop.simulate import simulate
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Loop

STILL = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.0, "T": 1e-6, "Td": 0.0},
        "controller": {"type": "P", "Kc": 1e-9},
        "sampling": {"Ts": 1.0, "n": 400},
        "disturbance": [{"type": "steps", "amplitude": 0.0, "period": 9.0}],
    }
)


# four harmonics overshoot the square wave, and their mean size is a little less
@pytest.mark.parametrize(("wave", "mean_size"), [("square", 0.948), ("triangular", 0.5)])
def test_a_wave_has_its_period_its_size_and_its_shape(wave, mean_size):
    pv = simulate(under_wave(STILL, wave, "output", 2.0, 80.0), seed=1).record.pv - 50.0
    assert pv[80:160] == pytest.approx(pv[160:240], abs=1e-6)
    assert np.ptp(pv) / 4.0 == pytest.approx(1.0, rel=0.25)
    assert np.abs(pv[80:160]).mean() / 2.0 == pytest.approx(mean_size, rel=0.01)


def test_an_echo_that_ends_higher_is_nearer_to_the_sticky_loop():
    ranked = [s for s in resolve(load_grid("ci").group(3)) if s.tags.get("ranked")]
    echo = next(s for s in ranked if s.tags.get("echo", "none") != "none")
    sticky = simulate(donor_of(echo.loop, echo.loop.disturbance[-1]), echo.seed).record.pv
    apart = [
        np.std(simulate(with_cut(echo.loop, cut), echo.seed).record.pv - sticky) for cut in CUTS
    ]
    assert apart == sorted(apart, reverse=True)
