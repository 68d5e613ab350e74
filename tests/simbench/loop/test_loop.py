"""The loop: the contract of one sample, one run, and its random numbers."""

import tomllib

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import perf
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.loop import plant
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.simulate import simulate, simulate_batch
from simbench.scenarios.spec import Loop

BASE = {
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.5},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
    "valve": {"model": "choudhury", "S": 5.0, "J": 2.0},
    "sampling": {"Ts": 1.0, "n": 600},
}


def loop(**changes) -> Loop:
    table = {k: dict(v) for k, v in BASE.items()}
    for section, values in changes.items():
        if isinstance(values, dict) and section in table and section != "valve":
            table[section].update(values)
        else:
            table[section] = values
    return Loop.from_table(table)


def load(kind: str, amplitude: float, period: float, at: str = "output") -> list[dict]:
    return [{"type": kind, "amplitude": amplitude, "period": period, "at": at}]


def to(*steps: list[float]) -> dict:
    """A set point of 50 that steps."""
    return {"value": 50.0, "steps": list(steps)}


IDEAL = {"model": "ideal"}


def step_response(num, den, Td, Ts, n, size=1.0):
    """Feed a step at sample 0 to the sampled plant."""
    p = plant.sample(np.atleast_1d(num).astype(float), np.asarray(den, dtype=float), Td, Ts)
    x, y = np.zeros(p.order), []
    w = np.concatenate([np.zeros(p.delay + 1), np.full(n, size)])
    for k in range(n):
        y.append(p.C @ x)
        x = p.A @ x + p.B_old * w[k] + p.B_new * w[k + 1]
    return np.array(y)


@pytest.mark.parametrize(
    ("num", "den"),
    [
        ([2.0], [10.0, 1.0]),
        ([0.3], [1.0, 0.0]),
        ([1.0, 2.0], [3.0, 4.0, 1.5]),
        ([1.0], [5.0, 1.0, 0.0]),
    ],
)
@pytest.mark.parametrize("Td", [0.0, 3.0, 2.5, 0.7, 0.2])
def test_step_response_equals_python_control(num, den, Td):
    Ts, n = 0.5, 120
    ours = step_response(num, den, Td, Ts, n)
    t = np.arange(n) * Ts
    # python-control has no dead time: its response at t - Td, asked for on a grid that holds these
    # times exactly
    late = t[t >= Td - 1e-12] - Td
    grid = np.union1d(late.round(10), [0.0])
    fine = np.arange(0, grid[-1] + 0.05, 0.1)
    theirs = control.step_response(control.tf(num, den), T=fine).outputs
    expected = np.concatenate(
        [np.zeros(t.size - late.size), theirs[np.round(late / 0.1).astype(int)]]
    )
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-10)


def test_direct_action_with_negative_gain_mirrors_the_loop():
    up = simulate(loop(noise={"std": 0.1}), seed=3).record
    down = simulate(
        loop(plant={"K": -1.0}, controller={"direction": "direct"}, noise={"std": 0.1}), seed=3
    ).record
    assert np.ptp(down.op) > 0
    # the same noise moves OP the other way
    assert np.sign(up.op[0] - 50) == -np.sign(down.op[0] - 50)


def test_op_stays_within_its_limits_and_leaves_them_at_once():
    far = to([10.0, 150.0], [200.0, 50.0])
    r = simulate(loop(valve=IDEAL, setpoint=far, sampling={"n": 260})).record
    assert r.op.max() == 100.0
    assert r.op[200] < 100.0  # no wound-up integral holds it there


def test_same_loop_and_seed_give_the_same_bits_and_another_seed_others():
    one = loop(noise={"std": 0.3}, disturbance=load("random_walk", 1.0, 50.0, "input"))
    a, b, c = simulate(one, 7).record, simulate(one, 7).record, simulate(one, 8).record
    np.testing.assert_array_equal(a.pv, b.pv)
    assert (a.pv != c.pv).any()


DEAD_TIME = st.floats(0, 20)


@settings(max_examples=40, deadline=None)
@given(
    plant=st.fixed_dictionaries(
        {"type": st.just("foptd"), "K": st.floats(0.1, 5), "T": st.floats(0.5, 50), "Td": DEAD_TIME}
    )
    | st.fixed_dictionaries(
        {"type": st.just("integrating"), "K": st.floats(0.005, 0.25), "Td": DEAD_TIME}
    ),
    controller=st.fixed_dictionaries(
        {"type": st.just("PI"), "Kc": st.floats(0.05, 5), "Ti": st.floats(1, 100)}
    )
    | st.fixed_dictionaries({"type": st.just("P"), "Kc": st.floats(0.05, 5)}),
    S=st.floats(0, 10),
    J=st.floats(0, 10),
    std=st.floats(0, 1),
    kick=st.floats(-10, 10),
)
def test_compiled_and_plain_loop_give_the_same_bits(plant, controller, S, J, std, kick):
    table = {
        "plant": plant,
        "controller": controller,
        "valve": {"model": "choudhury", "S": S, "J": J},
        "sampling": {"Ts": 1.0, "n": 200},
        "noise": {"std": std},
    }
    setup = resolve_loop(Loop.from_table(table), 1)
    fast, slow = run_setup(setup, kick=kick), run_setup(setup, kick=kick, plain=True)
    for name in ("op", "pv", "mv"):
        np.testing.assert_array_equal(getattr(fast.record, name), getattr(slow.record, name))


def test_compiled_and_plain_loop_of_higher_order_give_the_same_bits():
    setup = resolve_loop(loop(noise={"std": 0.1}), 1, tf=control.tf([1.0], [20.0, 12.0, 1.0]))
    np.testing.assert_array_equal(
        run_setup(setup).record.pv, run_setup(setup, plain=True).record.pv
    )


def test_compiled_loop_equals_c_bit_for_bit():
    case = perf.Case()
    if case.in_c is None:
        pytest.skip("no gcc on this machine")
    theirs = [a.copy() for a in case.run_c()]
    for a, b in zip(theirs, case.run(case.compiled), strict=True):
        np.testing.assert_array_equal(a, b)


def test_loop_equals_python_control_over_the_first_300_samples():
    case, theirs = perf.python_control(300)
    np.testing.assert_allclose(theirs(), np.array(case.run(case.compiled)[:2]), atol=1e-9)


def test_stages_stand_before_and_behind_any_friction_model():
    valve = BASE["valve"] | {"behind": [{"model": "limits", "low": 0.0, "high": 52.0}]}
    one = loop(valve=valve, setpoint=to([10.0, 55.0]))
    assert Loop.from_table(tomllib.loads(one.to_toml())) == one
    assert simulate(one).record.mv.max() == 52.0
    with pytest.raises(ParameterError, match="key model"):
        simulate(loop(valve={**valve, "behind": [{"low": 1.0}]}))
    with pytest.raises(UnknownName, match="limits"):
        simulate(loop(valve={**valve, "before": [{"model": "limit"}]}))


def test_a_batch_gives_each_loop_what_simulate_gives_it():
    loops = [loop(), loop().with_("sampling.n", 70)]
    for run, one in zip(
        simulate_batch(loops, [1, 2]), (simulate(loops[0], 1), simulate(loops[1], 2)), strict=True
    ):
        assert np.array_equal(run.record.pv, one.record.pv)
    with pytest.raises(ParameterError, match="2 loops and 1 seeds"):
        simulate_batch(loops, [1])
