"""Singhal & Salsbury 2005: area before the peak over area after it."""

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.methods.singhal_salsbury import area_ratio
from simbench.detectors.signal.half_cycles import HALF_CYCLE_POINTS

POINT = (np.arange(HALF_CYCLE_POINTS) + 0.5) / HALF_CYCLE_POINTS
T = np.arange(4000) / 20


def test_ratio_of_a_sine_is_one():
    assert area_ratio(np.sin(np.pi * POINT)[None].repeat(4, axis=0)) == pytest.approx(
        1.0, abs=0.005
    )


def test_ratio_is_the_geometric_one():
    late = np.minimum(POINT / 0.75, (1 - POINT) / 0.25)[None].repeat(4, axis=0)
    assert area_ratio(late) == pytest.approx(3.0, rel=0.15)
    assert area_ratio(late[:, ::-1]) == pytest.approx(1 / 3, rel=0.15)


def test_a_half_cycle_with_its_peak_at_an_end_counts_a_thousand_at_most():
    edge = (POINT < 1 / HALF_CYCLE_POINTS)[None].repeat(4, axis=0).astype(float)
    ratios = area_ratio(edge), area_ratio(edge[:, ::-1])
    assert ratios == pytest.approx((1e3, 1e-3))


@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("Td", [4.0, 6.0])
def test_error_after_a_sticky_valve_peaks_late(loop, noise, Td):
    verdict = judge(
        loop(T=3.0, Td=Td, Kc=0.25, Ti=3.0, Ts=0.5, n=4000, noise=noise), ["singhal_salsbury"]
    )[0]
    assert verdict.verdict == "stiction"
    assert verdict.indices["r_area"] > 2.0
