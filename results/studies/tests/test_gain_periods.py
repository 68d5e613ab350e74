"""The study of periods after a change of gain: what is simulated and what is printed."""

import math

import numpy as np
import pytest

from results.studies.gain_periods import FLOW, expected, told
from simbench.confirm.expected import Expected


def test_a_sticky_loop_far_from_its_limit_cycles_and_a_sound_one_does_not():
    flow = FLOW, {"Kc": 1.0, "Ti": 10.0}, 0.6
    assert len(expected(*flow, ()).changes) == 0
    stuck = expected(*flow, (3.0,))
    assert len(stuck.changes) == stuck.tried
    # a lower gain takes longer to move OP through the same band
    assert stuck.period == pytest.approx(1.0 / 0.6, rel=0.1)


def test_loops_that_stop_are_counted_and_have_no_period():
    changes = np.log([[2.0, 1.0], [4.0, 1.0], [math.e, 1.0]])
    changes[2] = np.nan
    assert told(Expected(changes, 8)) == (f"{math.sqrt(8.0):.2f}", "2 of 3")
    assert told(Expected(changes[2:], 8)) == ("-", "0 of 1")
