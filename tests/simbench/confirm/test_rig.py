"""Loops run side by side, against the compiled loop."""

import numpy as np
import pytest

from simbench.confirm.rig import run_rig
from simbench.detectors.errors import ParameterError
from simbench.loop.resolve import resolve_loop
from simbench.loop.simulate import simulate

CASES = [
    {},
    {"noise": 0.2, "setpoint": {"value": 50, "steps": [[100, 53]]}},
    {
        "kind": "integrating",
        "K": 0.1,
        "disturbance": [{"type": "steps", "amplitude": 5, "period": 200}],
    },
    {
        "K": -2.0,
        "effect": [{"name": "sensor_lag", "tau": 3.0}, {"name": "op_quantisation", "step": 0.5}],
    },
    {"controller": {"type": "P", "Kc": 3.0}, "setpoint": {"value": 50, "steps": [[10, 58]]}},
]


@pytest.mark.parametrize("case", CASES)
def test_a_rig_left_alone_is_the_compiled_loop_bit_for_bit(loop, case):
    asked = loop(**case)
    [trace] = run_rig([resolve_loop(asked, 3)])
    record = simulate(asked, 3).record
    assert all(np.array_equal(getattr(trace, x), getattr(record, x)) for x in ("op", "mv", "pv"))


def test_changing_the_gain_of_pi_does_not_bump_op(loop):
    gain = np.where(np.arange(1500) < 700, 1.0, 0.3)
    asked = loop(valve={"model": "ideal"}, setpoint={"value": 50, "steps": [[10, 54]]})
    [trace] = run_rig([resolve_loop(asked, 0)], gain=[gain])
    assert abs(trace.op[700] - trace.op[699]) < 1e-6


def test_influence_is_a_load_by_the_other_loop(loop):
    steps = ([], [[10, 54]])
    pair = [loop(valve={"model": "ideal"}, setpoint={"value": 50, "steps": s}) for s in steps]
    alone = run_rig([resolve_loop(x, 0) for x in pair])
    assert np.ptp(alone[0].pv) == 0
    one_way = run_rig([resolve_loop(x, 0) for x in pair], influence=np.array([[0, 0.5], [0, 0]]))
    assert np.ptp(one_way[0].pv) > 0.5
    assert np.array_equal(one_way[1].pv, alone[1].pv)


def test_loops_of_different_sampling_are_refused(loop):
    with pytest.raises(ParameterError, match="same sampling"):
        run_rig([resolve_loop(loop(), 0), resolve_loop(loop(Ts=2.0), 0)])
