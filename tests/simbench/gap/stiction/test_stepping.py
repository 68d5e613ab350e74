"""An OP that is sent only after a change of a least size is said to be; rounding, and an ordinary
OP, are not.
"""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.stiction import causes
from simbench.gap.stiction.causes import least_step
from simbench.gap.stiction.conclusion import judged


def sent(x, change):
    """Return a signal that is sent only after a change."""
    out, last = np.empty_like(x), x[0]
    for k, value in enumerate(x):
        last = value if abs(value - last) >= change else last
        out[k] = last
    return out


WANDERS = 50.0 + np.cumsum(2.0 * np.random.default_rng(2).standard_normal(1500))


@pytest.mark.parametrize("size", [8.0, 12.0])
def test_the_least_move_is_found(size):
    assert least_step(sent(WANDERS, size)) == pytest.approx(size, rel=0.2)


@pytest.mark.parametrize(
    "op", [WANDERS, np.round(WANDERS / 5.0) * 5.0, sent(WANDERS, 0.2), np.full(300, 50.0)]
)
def test_an_ordinary_op_a_rounded_one_and_one_at_rest_move_in_no_such_steps(op):
    assert least_step(op) is None


def test_a_loop_whose_op_is_sent_after_ten_percent_is_not_said_to_answer_nothing():
    op = sent(WANDERS, 10.0)
    pv = np.zeros(op.size)
    for k in range(1, op.size):
        pv[k] = 0.98 * pv[k - 1] + 0.02 * 0.3 * (op[k - 1] - 50.0)
    found = judged(LoopRecord(op, 20.0 + pv, 60.0, op_span=(0.0, 100.0)))[0]
    assert found.cause == causes.STEPPED
    assert "OP moves in steps of at least 10" in found.reason
    assert "smaller changes" in found.next or found.verdict == "no_decision"
