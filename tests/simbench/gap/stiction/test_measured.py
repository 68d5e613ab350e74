"""What an archive repeats or draws between samples is not taken for measured."""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.stiction.deniable import HELD, unheld


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
