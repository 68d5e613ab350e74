"""What an archive repeats or draws between samples is not taken for measured."""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.stiction.measured import HELD, measured_samples, unheld


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
    t, rng = np.arange(1000), np.random.default_rng(0)
    pv = np.sin(t / 60.0) + 0.1 * rng.standard_normal(1000)
    record = LoopRecord(op=50 + np.cos(t / 60.0), pv=pv, Ts=2.0)
    record = LoopRecord(op=record.op, pv=change(record.pv), Ts=record.Ts)
    assert measured_samples(record) == pytest.approx(share * record.n, abs=10)
