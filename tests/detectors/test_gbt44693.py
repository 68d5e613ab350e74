"""GB/T 44693.2, F.2: the axis ratio of ellipses that are known, and the verdicts that follow."""

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.methods.gbt44693 import axis_ratio
from simbench.detectors.record import LoopRecord

T = 2 * np.pi * np.arange(4000) / 50.0


@pytest.mark.parametrize("ratio", [0.05, 0.2, 0.3, 0.7])
def test_axis_ratio_of_an_ellipse_at_45_degrees_is_that_of_its_axes(ratio):
    # turned by 45 degrees both coordinates have one range, by which they are divided
    a, b = np.cos(T), ratio * np.sin(T)
    assert axis_ratio(3.0 + a - b, 7.0 + a + b) == pytest.approx(ratio, rel=1e-6)


@pytest.mark.parametrize("phase", [0.2, 0.6, 1.2])
def test_axis_ratio_of_two_sines_is_the_tangent_of_half_their_phase(phase):
    assert axis_ratio(5.0 * np.sin(T), -0.1 * np.sin(T - phase)) == pytest.approx(
        np.tan(phase / 2), rel=1e-3
    )


def record(phase, scale=1.0):
    return LoopRecord(50 + 5 * np.sin(T), scale * np.sin(T - phase), 1.0, process="self-regulating")


def test_the_bound_lies_at_an_axis_ratio_of_three_tenths():
    at = 2 * np.arctan(0.3)
    verdicts = [judge(record(at + off), ["gbt44693"])[0].verdict for off in (-0.02, 0.02)]
    assert verdicts == ["no_stiction", "stiction"]
    assert judge(record(at + 0.02, scale=1e4), ["gbt44693"])[0].verdict == "stiction"


def test_points_without_a_long_axis_are_no_decision_where_that_is_asked():
    asked = {"gbt44693": {"line_low": 0.5}}
    assert judge(record(1.3), ["gbt44693"])[0].verdict == "stiction"
    without = judge(record(1.3), ["gbt44693"], thresholds=asked)[0]
    assert without.verdict == "no_decision"
    assert "no long axis" in without.reason
    assert judge(record(0.7), ["gbt44693"], thresholds=asked)[0].verdict == "stiction"


def test_a_healthy_loop_under_a_sine_is_accused_by_the_phase_of_its_controller(loop):
    load = 2.0 * np.sin(2 * np.pi / 60.0 * 0.5 * np.arange(4000))
    healthy = loop(
        S=0.0,
        J=0.0,
        T=3.0,
        Td=1.0,
        Kc=0.3,
        Ti=60.0 / (2 * np.pi),
        Ts=0.5,
        n=4000,
        load=load,
        kick=0.0,
    )
    assert judge(healthy, ["gbt44693"])[0].verdict == "stiction"
