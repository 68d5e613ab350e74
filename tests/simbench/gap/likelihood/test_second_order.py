"""A valve or positioner of second order that overshoots is told from friction by MV, and is said to
be the cause; a first-order lag and a valve that sticks are no such thing.
"""

import numpy as np
import pytest
from scipy.signal import lfilter, lsim

from simbench.detectors.record import LoopRecord
from simbench.gap.likelihood.valve_map import lag_second_order
from simbench.gap.stiction import causes
from simbench.gap.stiction.conclusion import judged

RNG = np.random.default_rng(4)
OP = 50.0 + lfilter([0.15], [1.0, -0.97], RNG.standard_normal(2000)) * 6.0


def test_the_response_is_that_of_the_differential_equation():
    t = np.arange(60.0)
    step = np.where(t >= 5.0, 1.0, 0.0)
    fine = np.arange(0.0, 60.0, 0.01)
    _, exact, _ = lsim(([1.0], [4.0, 0.8, 1.0]), (fine >= 5.0) * 1.0, fine)
    ends = exact[99::100]
    assert lag_second_order(step, 2.0, 0.2, 0.0)[: ends.size] == pytest.approx(ends, abs=0.01)


def test_a_positioner_that_overshoots_is_the_cause_and_not_stiction():
    mv = lag_second_order(OP, 0.8, 0.15, OP[0])
    pv = 20.0 + lfilter([0.0, 0.1], [1.0, -0.9], mv - 50.0) + 0.05 * RNG.standard_normal(OP.size)
    found = judged(LoopRecord(OP, pv, 1.0, mv=np.round(mv, 1), op_span=(0.0, 100.0)))[0]
    assert found.verdict != "stiction"
    assert found.cause == causes.POSITIONER
    assert "damping 0.15" in found.reason
    assert "positioner" in found.next
