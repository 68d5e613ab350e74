"""A corrected loop rests where the record lies."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.closed_loop.level import level
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TABLE = {
    "plant": {"type": "foptd", "K": 2.0, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 0.4, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.2},
    "setpoint": {"value": 60.0, "steps": [[100.0, 64.0]]},
    "operating_point": {"op0": 55.0, "pv0": 60.0},
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 20.0}],
}


@pytest.mark.parametrize("controller", [TABLE["controller"], {"type": "P", "Kc": 0.4}])
def test_a_loop_begun_elsewhere_is_moved_to_the_level_of_the_record(controller):
    true = Loop.from_table({**TABLE, "controller": controller})
    record = simulate(true, seed=3).record
    moved = true.with_all({"operating_point.op0": 46.0})
    levelled = level(SimpleNamespace(op=record.op, record=record), moved, 0.0)
    again = simulate(levelled, seed=50).record
    assert abs(again.op.mean() - record.op.mean()) < 0.3 * np.std(record.op)
    assert abs(again.pv.mean() - record.pv.mean()) < 0.3 * np.std(record.pv)
    before = simulate(moved, seed=50).record
    assert abs(before.op.mean() - record.op.mean()) > np.std(record.op)
