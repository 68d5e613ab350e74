"""Rhythm: what it sees of cycles that wander, and that it sees no shape."""

import numpy as np
import pytest

from simbench.bench.score.rhythm import RHYTHM, rhythm_features
from simbench.detectors.record import LoopRecord

N, PERIOD = 2000, 40.0


def features(wave, phase=0.0, size=1.0, drift=0.0):
    x = size * wave(2 * np.pi * np.arange(N) / PERIOD + phase) + drift
    record = LoopRecord(op=50 + x, pv=50 + np.roll(x, 7), Ts=2.0)
    return dict(zip(RHYTHM, rhythm_features(record, 2.0 * PERIOD), strict=True))


def sine(a):
    return np.sin(a)


def corners(a):
    return np.sign(np.sin(a)) + 0.3 * np.sin(2 * a)


def walk(seed, scale):
    rng = np.random.default_rng(seed)
    return np.cumsum(scale * rng.standard_normal(N))


@pytest.mark.parametrize("name", ["op_length_spread", "op_size_spread", "op_mean_spread"])
def test_a_steady_wave_has_no_spread_whatever_its_shape(name):
    for wave in (sine, corners):
        assert features(wave)[name] < 0.05


def test_what_wanders_is_seen_where_it_wanders():
    assert features(sine, phase=walk(1, 0.05))["op_length_spread"] > 0.03
    assert features(sine, size=1.0 + 0.05 * walk(2, 0.3))["op_size_spread"] > 0.05
    drifting = features(sine, drift=walk(3, 0.05))
    assert drifting["op_mean_spread"] > 0.2
    assert drifting["op_mean_next"] > 0.5


def test_without_a_period_there_is_nothing_to_see():
    record = LoopRecord(op=np.full(50, 1.0), pv=np.arange(50.0), Ts=1.0)
    assert not rhythm_features(record, float("nan")).any()
    assert not rhythm_features(record, 40.0).any()
    assert not rhythm_features(record, 20.0)[:6].any()
