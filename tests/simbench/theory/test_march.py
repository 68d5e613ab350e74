"""The compiled march against an obvious loop of the project's valve and plant, and against the
simulator.
"""

import numpy as np
import pytest

from simbench.loop.parameters import valve_parameters
from simbench.loop.simulate import simulate
from simbench.loop.valves import choudhury, he
from simbench.theory.cycle import after_load_step, at_rest
from simbench.theory.march import march, reversals
from simbench.theory.sampled import sampled_loop


def slow_march(sampled, kick, n, model=choudhury):
    """OP and MV of the first n samples after a kick, every signal kept, the valve from its file
    around 50 %.
    """
    p = valve_parameters(model, {"S": sampled.S, "J": sampled.J}, sampled.Ts)
    op, mv, y = [], [], []
    x, valve = np.zeros(sampled.order), model.start(50.0, p)
    for k in range(n):
        y.append(float(sampled.C @ x))
        if k == 0:
            u = kick
        elif sampled.integral:
            u = op[-1] - (y[k] - y[k - 1]) - sampled.beta * y[k]
        else:
            u = -y[k]
        u = min(max(u, sampled.lo), sampled.hi)
        valve = model.step(50.0 + u, valve, p)
        op.append(u)
        mv.append(valve[0] - 50.0)
        new, old = (mv[k - d] if k >= d else 0.0 for d in (sampled.delay, sampled.delay + 1))
        x = sampled.A @ x + sampled.B_new * new + sampled.B_old * old
    return np.array(op), np.array(mv)


def marched(sampled, kick, n):
    """The same by `march`, one sample at a time."""
    state = at_rest(sampled, kick)
    op, mv = [state[1][0]], [state[1][2]]
    for _ in range(n - 1):
        reversals(sampled, *state, 2, most=1)
        op.append(state[1][0])
        mv.append(state[1][2])
    return np.array(op), np.array(mv)


@pytest.mark.parametrize(
    "case",
    [
        {},
        {"Td": 0.0, "J": 5.0},
        {"Td": 2.3, "J": 7.0},
        {"Td": 0.4, "J": 0.0, "Ti": 4.0, "Kc": 6.0},
        {"Ti": None, "Kc": 4.0},
        {"kind": "integrating", "K": 0.1, "Ti": 30.0, "Kc": 1.5, "J": 0.0},
        {"kind": "integrating", "K": 0.3, "Ti": 2.0, "Kc": 3.0},  # unstable: runs into the limits
    ],
)
def test_march_equals_the_obvious_loop(loop, case):
    sampled = sampled_loop(loop(Ts=0.7, **case))
    for kick in (1.01 * sampled.fs, 2 * sampled.fs):
        for fast, slow in zip(
            marched(sampled, kick, 300), slow_march(sampled, kick, 300), strict=True
        ):
            assert np.abs(fast - slow).max() < 1e-6  # rounding grows from cycle to cycle


@pytest.mark.parametrize("case", [{}, {"Td": 2.3, "J": 4.0}, {"Ti": None, "Kc": 4.0}])
def test_march_of_a_valve_that_sticks_again_equals_the_obvious_loop(loop, case):
    J = case.get("J", 2.0)
    sampled = sampled_loop(loop(Ts=0.7, **case, valve={"model": "he", "S": 5.0, "J": J}))
    assert sampled.resticks
    for fast, slow in zip(
        marched(sampled, 5.0, 300), slow_march(sampled, 5.0, 300, he), strict=True
    ):
        assert np.abs(fast - slow).max() < 1e-6


@pytest.mark.parametrize("Td", [0.5, 2.0])
def test_march_of_a_pid_loop_equals_the_simulator_before_chaos_sets_in(loop, Td):
    law = {"type": "PID", "Kc": 0.5, "Ti": 10, "Td": Td, "N": 8, "form": "velocity", "b": 1, "c": 1}
    asked = loop(K=2.0, Kc=0.5, Td=2.3, Ts=0.5, n=300, controller=law)
    record = simulate(asked, kick=4.0).record
    op, mv = marched(sampled_loop(asked), 4.0, 300)
    assert np.abs(record.op - 50 - op).max() < 1e-8
    assert np.abs(record.mv - 50 - mv).max() < 1e-8


@pytest.mark.parametrize(
    "case", [{}, {"Ti": None, "Kc": 4.0}, {"kind": "integrating", "K": 0.1, "Ti": None, "Kc": 2.0}]
)
def test_load_step_of_the_march_equals_that_of_the_simulator(loop, case):
    asked = loop(
        **case,
        Ts=0.5,
        n=200,
        disturbance=[{"type": "ramp", "amplitude": 6.0, "period": 0.5, "at": "input"}],
    )
    record = simulate(asked).record
    sampled = sampled_loop(asked)
    state = after_load_step(sampled, 6.0)
    balance = 50 - state[1][0]
    op = [state[1][0]]
    for _ in range(150):
        reversals(sampled, *state, 2, most=1)
        op.append(state[1][0])
    # the load acts from sample 1 on, and is seen after the dead time
    seen = 1 + sampled.delay
    assert np.abs(record.op[seen : seen + 151] - balance - op).max() < 1e-8


def test_plain_and_compiled_march_agree(loop):
    sampled = sampled_loop(loop(Ts=0.5))
    ends = []
    for function in (march, march.py_func):
        x, s, past = at_rest(sampled, 4.0)
        arrays = np.zeros((4, 8))
        plant = (sampled.A, sampled.B_old, sampled.B_new, sampled.C)
        control = (sampled.integral, sampled.beta, sampled.lo, sampled.hi)
        valve = sampled.fs, sampled.fd, False
        function(plant, control, valve, (x, s, past), 400, 400, arrays)
        ends.append(np.concatenate([x, s, past, arrays.ravel()]))
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
