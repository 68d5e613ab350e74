"""A recorded MV is the plant's input within its digits, and strays where no valve makes it."""

from types import SimpleNamespace

import numpy as np

from simbench.gap.decide.recorded_mv import by_stem
from simbench.gap.likelihood.model import Data
from simbench.scenarios.parts import Part


def test_mv_is_what_the_valve_makes_of_op_within_the_digits_it_was_logged_in():
    rng = np.random.default_rng(2)
    op = 50.0 + np.cumsum(rng.standard_normal(200))
    mv = np.round(op, 1)
    mv[100:] += 0.5
    data = Data(op, op - 50.0, 1.0, 10.0, 2.0, 0.1)
    baseline = SimpleNamespace(
        valve=Part(name="ideal"), controller=SimpleNamespace(Kc=1.0), effect=()
    )
    record = SimpleNamespace(Ts=1.0, mv=mv)
    s = SimpleNamespace(data=data, op=op, baseline=baseline, record=record)
    seen = by_stem(s, {"stiction": (0.0, {})}).u
    np.testing.assert_array_equal(seen[:100], op[:100])
    np.testing.assert_array_equal(seen[100:], mv[100:])
    # MV that was logged before OP had moved is the valve's a moment later
    record.mv = np.round(op - 0.8 * np.diff(op, prepend=op[0]), 3)
    np.testing.assert_array_equal(by_stem(s, {"stiction": (0.0, {})}).u, op)
