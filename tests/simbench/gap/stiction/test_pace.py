"""A record is thinned to the pace at which its loop moves, and to no other."""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.stiction.pace import HELD, SHORTEST_LEFT, at_its_pace, measured_samples, unheld


def slow(n, period=400.0, noise=0.0):
    t, rng = np.arange(n), np.random.default_rng(0)
    pv = np.sin(2 * np.pi * t / period) + noise * rng.standard_normal(n)
    return LoopRecord(op=50 + np.cos(2 * np.pi * t / period), pv=pv, sp=0 * pv, Ts=2.0)


def test_a_sine_keeps_some_thirty_samples_a_period():
    thinned = at_its_pace(slow(12_000))
    assert 28 <= 400 * 2.0 / thinned.Ts <= 33
    k = round(thinned.Ts / 2.0)
    assert np.array_equal(thinned.pv, slow(12_000).pv[::k])
    assert thinned.n == thinned.op.size == thinned.sp.size


def test_noise_that_moves_from_sample_to_sample_keeps_all():
    record = slow(12_000, noise=0.12)
    assert at_its_pace(record) is record


def test_an_oscillation_with_a_larger_drift_keeps_its_shape():
    record, period = slow(12_000, period=60.0), 60.0 * 2.0
    drift = 30.0 * np.sin(2 * np.pi * np.arange(12_000) / 9000.0)
    thinned = at_its_pace(LoopRecord(op=record.op, pv=record.pv + drift, Ts=2.0))
    assert 20 <= period / thinned.Ts <= 40


@pytest.mark.parametrize("n", [SHORTEST_LEFT, 2 * SHORTEST_LEFT - 1, 2 * SHORTEST_LEFT + 1, 1000])
def test_enough_samples_are_left(n):
    assert at_its_pace(slow(n)).n >= SHORTEST_LEFT


def test_mv_is_left_out_with_the_samples():
    record = slow(12_000)
    with_mv = LoopRecord(op=record.op, pv=record.pv, mv=record.op, Ts=2.0)
    assert at_its_pace(with_mv).mv is None


@pytest.mark.parametrize(("k", "phase"), [(2, 0), (4, 3)])
def test_a_pv_that_is_held_keeps_one_sample_of_each_hold(k, phase):
    pv = np.sin(np.arange(1000) / 9.0)
    held = np.roll(np.repeat(pv[::k], k), phase)
    seen = unheld(LoopRecord(op=np.cos(np.arange(1000) / 9.0), pv=held, Ts=1.0))
    assert seen.Ts == k
    assert np.all(np.diff(seen.pv[1:-1]) != 0.0)
    assert HELD <= seen.n <= 1000 // k


def test_a_pv_that_moves_or_rests_at_random_is_left_as_it_is():
    rng = np.random.default_rng(0)
    moving = LoopRecord(op=rng.standard_normal(600), pv=rng.standard_normal(600), Ts=1.0)
    assert unheld(moving) is moving
    resting = LoopRecord(op=moving.op, pv=np.round(np.cumsum(moving.pv) / 4), Ts=1.0)
    assert unheld(resting) is resting


@pytest.mark.parametrize(("change", "share"), [
    (lambda x: x, 1.0),
    (lambda x: np.repeat(x[::5], 5), 0.2),
    (lambda x: np.interp(np.arange(x.size), np.arange(0, x.size, 5), x[::5]), 0.2),
])  # fmt: skip
def test_samples_that_an_archive_repeats_or_draws_are_not_measured(change, share):
    record = slow(1000, noise=0.1)
    record = LoopRecord(op=record.op, pv=change(record.pv), Ts=record.Ts)
    assert measured_samples(record) == pytest.approx(share * record.n, abs=10)
