"""Periods after a change of gain: a sticky loop cycles far from its limit, a sound one does not."""

import pytest

from results.studies.gain_periods import FLOW, expected


def test_a_sticky_loop_far_from_its_limit_cycles_and_a_sound_one_does_not():
    flow = FLOW, {"Kc": 1.0, "Ti": 10.0}, 0.6
    assert len(expected(*flow, ()).changes) == 0
    stuck = expected(*flow, (3.0,))
    assert len(stuck.changes) == stuck.tried
    # a lower gain takes longer to move OP through the same band
    assert stuck.period == pytest.approx(1.0 / 0.6, rel=0.1)
