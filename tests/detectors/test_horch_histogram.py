"""Horch 2006: the histogram of the differences of PV."""

import numpy as np
import pytest
from plain_loops import LEVEL
from scipy.integrate import quad
from scipy.stats import norm

from simbench.detectors.judge import judge
from simbench.detectors.methods import horch_histogram as h
from simbench.detectors.record import LoopRecord

T = np.arange(4000) / 20


def test_camel_density_is_the_integral_over_the_phase():
    width = h.BINS[1] - h.BINS[0]
    camels = h._mean_densities(1.0)[1]
    A, sigma = np.meshgrid(np.linspace(1.0, 1.6, 13), np.geomspace(0.1, 1.0, 19))
    for k in (0, 57, 129):
        a, s = A.ravel()[k], sigma.ravel()[k]
        for b in (3, 10, 15, 22):
            lo, hi = h.BINS[b], h.BINS[b + 1]

            def mass(phi, a=a, s=s, lo=lo, hi=hi):
                return norm.cdf(hi, a * np.cos(phi), s) - norm.cdf(lo, a * np.cos(phi), s)

            assert camels[k, b] == pytest.approx(quad(mass, 0, np.pi)[0] / np.pi / width, abs=2e-3)


def test_a_camel_is_never_a_gaussian():
    camel, gauss = h.density_errors(np.random.default_rng(0).standard_normal(50_000))
    assert camel > 10 * gauss
    camel, gauss = h.density_errors(np.sin(np.arange(50_000) * 0.37))
    assert gauss > 10 * camel


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("J", [0.0, 2.0, 5.0])
def test_level_after_a_sticky_valve_has_a_central_peak(loop, J, noise):
    plant = {
        **LEVEL,
        "n": 4000,
        "kick": 6.0,
    }
    assert judge(loop(J=J, noise=noise, **plant), ["horch_histogram"])[0].verdict == "stiction"


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.15])
def test_sine_has_two_humps(noise):
    pv = np.sin(T) + noise * np.random.default_rng(3).standard_normal(4000)
    for process in ("integrating", "self-regulating"):
        verdict = judge(LoopRecord(np.cos(T), pv, 0.05, process=process), ["horch_histogram"])[0]
        assert verdict.verdict == "no_stiction", verdict
