"""Horch 1999: what the two indices measure, and that they measure w Ti."""

import numpy as np
import pytest
from naive import horch_indices
from plain_loops import DELAYED

from simbench.detectors.judge import judge
from simbench.detectors.methods.horch import correlation_indices
from simbench.detectors.record import LoopRecord

T = np.arange(4000) / 20


@pytest.mark.parametrize("delta", np.linspace(0.05, 1.5, 13))
def test_indices_of_sinusoids_are_functions_of_their_phase(delta):
    dtau, drho = correlation_indices(np.sin(T), -np.sin(T - delta))
    assert dtau == pytest.approx(delta / (np.pi / 2), abs=0.01)
    assert drho == pytest.approx((1 - np.cos(delta)) / (1 + np.cos(delta)), abs=0.02)


def test_indices_equal_the_lag_by_lag_sums():
    for seed in range(5):
        rng = np.random.default_rng(seed)
        k = np.arange(600)
        op = np.sin(k / 8) + 0.2 * rng.standard_normal(600)
        pv = np.cos(k / 8 + rng.random()) + 0.2 * rng.standard_normal(600)
        assert correlation_indices(op, pv) == pytest.approx(horch_indices(op, pv), abs=1e-9)


def test_indices_do_not_depend_on_the_sign_of_pv():
    op, pv = np.sin(T), np.sin(T - 0.8)
    assert correlation_indices(op, pv) == pytest.approx(correlation_indices(op, -pv))


def linear_loop_under_a_sine(loop, w_Ti, Kc):
    w, Ts, n = 2 * np.pi / 60.0, 0.5, 4000
    load = 2.0 * np.sin(w * Ts * np.arange(n))
    return loop(S=0.0, J=0.0, T=3.0, Td=1.0, Kc=Kc, Ti=w_Ti / w, Ts=Ts, n=n, load=load, kick=0.0)


@pytest.mark.parametrize(
    ("w_Ti", "Kc", "verdict"),
    [(10.0, 0.3, "no_stiction"), (1.0, 0.3, "no_decision"), (0.1, 0.1, "stiction")],
)
def test_verdict_on_a_healthy_loop_under_a_sine_follows_w_Ti_alone(loop, w_Ti, Kc, verdict):
    answer = judge(linear_loop_under_a_sine(loop, w_Ti, Kc), ["horch"])[0]
    assert answer.verdict == verdict
    assert answer.indices["dtau"] == pytest.approx(2 / np.pi * np.arctan(1 / w_Ti), abs=0.03)


@pytest.mark.parametrize(
    ("plant", "dtau", "drho"),
    [
        ({"T": 10.0, "Td": 2.0, "Kc": 1.0, "Ti": 10.0, "Ts": 0.2, "kick": 3.0}, 0.64, 0.26),
        ({**DELAYED, "Ts": 0.5, "kick": 3.0}, 0.88, 0.63),
    ],
)
def test_indices_of_published_sticky_loops(loop, plant, dtau, drho):
    n = 6000
    record = loop(n=n, load=np.where(np.arange(n) > n // 20, 1.5, 0.0), **plant)
    indices = judge(record, ["horch"])[0].indices
    assert indices["dtau"] == pytest.approx(dtau, abs=0.03)
    assert indices["drho"] == pytest.approx(drho, abs=0.03)


def test_integrating_process_is_refused_and_an_unknown_one_judged_with_a_note():
    about = {"op": np.sin(T), "pv": np.cos(T), "Ts": 0.05}
    refused = judge(LoopRecord(**about, process="integrating"), ["horch"])[0]
    assert (refused.verdict, refused.applicable) == ("no_decision", False)
    unknown = judge(LoopRecord(**about), ["horch"])[0]
    assert (unknown.verdict, unknown.applicable) == ("stiction", None)
    assert "process type unknown" in unknown.reason
