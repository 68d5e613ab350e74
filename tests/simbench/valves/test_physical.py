"""The friction models against fixed steps, against other solvers, and against the maps they are
meant to be.
"""

import math

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.response import valve_response

SJ = {"S": 5.0, "J": 2.0}
PUBLISHED = {}
CRITICAL = 2.0 * np.sqrt(52538.0 * 1.36)


@numba.njit
def _steps(op, valve, n, h, mv):
    Fs, Fc, Fv, vs, m, k, stroke, dv = valve
    x, v = op[0] / 100.0 * stroke, 0.0
    for i in range(op.size):
        F = op[i] / 100.0 * k * stroke
        for _ in range(n):
            net = F - k * x
            if v == 0.0 and abs(net) <= Fs:
                continue
            sign = math.copysign(1.0, net if v == 0.0 else v)
            friction = Fc + ((Fs - Fc) * math.exp(-((v / vs) ** 2)) if vs > 0.0 else 0.0)
            new = v + h * (net - sign * friction - Fv * v) / m
            if sign * new <= dv:
                new = 0.0
            v = new
            x += h * v
        mv[i] = 100.0 * x / stroke


def friction_in_steps(op, p, h, vs=0.0):
    """Karnopp's discrete rule, semi-implicit Euler, `h` s per step; op (n,) in %, returns MV (n,)
    in %.
    """
    mv = np.empty(op.size)
    n = round(p.Ts / h)
    valve = p.Fs, p.Fc, p.Fv, vs, p.m, p.k, p.stroke, getattr(p, "dv", 1e-9)
    _steps(op, valve, n, p.Ts / n, mv)
    return mv


def parameters(model, table, Ts):
    return valve_parameters(VALVES.load(model), table, Ts)


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def count_jumps(mv):
    fast = np.diff(mv) > 0.3
    return int(np.sum(fast[1:] & ~fast[:-1]))


def sine(period, Ts=0.01):
    return 50.0 + 45.0 * np.sin(2.0 * np.pi * np.arange(0.0, period, Ts) / period)


def held_op(n=400, seed=0):
    return np.clip(50.0 + np.cumsum(np.random.default_rng(seed).normal(0.0, 2.0, n)), 0.0, 100.0)


def test_published_actuator_and_its_band():
    p = parameters("coulomb", PUBLISHED, 1.0)
    assert p.k * p.stroke == pytest.approx(5337.86, abs=0.01)
    assert p.Fv / (2.0 * np.sqrt(p.k * p.m)) == pytest.approx(1.14476, abs=1e-5)
    assert pytest.approx(58.63772243742288) == p.S
    assert pytest.approx(5.320483441606421) == p.J


@pytest.mark.parametrize("model", ["coulomb", "karnopp", "stribeck", "lugre"])
def test_band_and_forces_map_both_ways(model):
    from_band = parameters(model, SJ, 1.0)
    from_forces = parameters(model, {"Fs": from_band.Fs, "Fc": from_band.Fc}, 1.0)
    assert pytest.approx(5.0) == from_forces.S
    assert pytest.approx(2.0) == from_forces.J
    assert VALVES.load(model).mapped_SJ(from_forces) == pytest.approx((5.0, 2.0))


@pytest.mark.parametrize(
    ("h", "largest", "mean_square"),
    [
        (2e-3, 0.3783, 0.003839),
        (1e-3, 0.2077, 0.002108),
        (5e-4, 0.1076, 0.0010926),
        (1e-4, 0.02204, 0.00022403),
    ],
)
def test_fixed_steps_miss_the_exact_valve_by_the_published_amounts(h, largest, mean_square):
    # reference sheet 1.8: Karnopp's rule against the exact solution, OP sine of 45 %, 200 s
    p = parameters("coulomb", PUBLISHED, 0.01)
    op = sine(200.0)
    error = friction_in_steps(op, p, h) - valve_response("coulomb", op, PUBLISHED, 0.01)
    assert np.abs(error).max() == pytest.approx(largest, rel=2e-3)
    assert rms(error) == pytest.approx(mean_square, rel=3e-3)


@pytest.mark.parametrize("table", [SJ, PUBLISHED])
def test_exact_valve_is_the_limit_of_substeps_and_halving_the_step_halves_the_error(table):
    op = sine(200.0)
    exact = valve_response("coulomb", op, table, 0.01)
    error = [
        rms(valve_response("coulomb", op, {**table, "substep": h}, 0.01) - exact)
        for h in (2e-4, 1e-4, 5e-5)
    ]
    assert error[1] <= 2e-4
    assert error[0] / error[1] == pytest.approx(2.0, abs=0.1)
    assert error[1] / error[2] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("table", [SJ, {"S": 3, "J": 1}, {"S": 8, "J": 0}, PUBLISHED])
def test_smoothly_driven_valve_is_the_stiction_map(table):
    op = sine(200.0)
    p = parameters("coulomb", table, 0.01)
    mapped = valve_response("choudhury", op, {"S": p.S, "J": p.J})
    for model in ("coulomb", "karnopp"):
        assert rms(valve_response(model, op, table, 0.01) - mapped) <= 0.1


def test_valve_that_comes_to_rest_in_every_sample_is_hes_map():
    op = held_op(1000)
    for table in (SJ, {"S": 4, "J": 4}, {"S": 4, "J": 0}):
        np.testing.assert_allclose(
            valve_response("coulomb", op, table, 1.0), valve_response("he", op, table), atol=1e-7
        )


@pytest.mark.parametrize(
    "Fv", [0.0, 20.0, 200.0, 0.9999 * CRITICAL, CRITICAL, 1.0001 * CRITICAL, 5000.0]
)
def test_any_damping_is_solved_like_fine_steps(Fv):
    table = {**SJ, "Fv": Fv}
    op = np.repeat(50.0 + 25.0 * np.sin(np.arange(40) * 0.7), 2)
    exact = valve_response("coulomb", op, table, 0.02)
    p = parameters("coulomb", table, 0.02)
    coarse, fine = (np.abs(friction_in_steps(op, p, h) - exact).max() for h in (4e-6, 1e-7))
    assert np.ptp(exact) > 20
    assert fine < 1e-3
    assert fine < 0.2 * coarse


def test_karnopp_valve_creeps_only_above_its_band():
    slow = 30.0 + 0.02 * np.arange(0, 400, 0.01)
    assert count_jumps(valve_response("coulomb", slow, SJ, 0.01)) == 1
    # break-away at 33.5, then every J = 2 up to 38
    assert count_jumps(valve_response("karnopp", slow, SJ, 0.01)) == 3
    fast = 30.0 + 0.1 * np.arange(0, 400, 0.01)
    np.testing.assert_allclose(
        valve_response("karnopp", fast, SJ, 0.01),
        valve_response("coulomb", fast, SJ, 0.01),
        atol=1e-6,
    )


def test_coulomb_viscous_is_coulomb_with_equal_forces():
    op = held_op(300)
    np.testing.assert_array_equal(
        valve_response("coulomb_viscous", op, {"S": 5}, 0.01),
        valve_response("coulomb", op, {"S": 5, "J": 0}, 0.01),
    )
    p = parameters("coulomb_viscous", {"Fc": 100.0}, 1.0)
    assert pytest.approx(200.0 * 100.0 / (p.k * p.stroke)) == p.S


@pytest.mark.parametrize(("table", "bound"), [(SJ, 1e-4), (PUBLISHED, 1e-4)])
def test_stribeck_solver_equals_extrapolated_substeps(table, bound):
    op = sine(20.0)
    exact = valve_response("stribeck", op, table, 0.01)
    coarse, fine = (
        valve_response("stribeck", op, {**table, "substep": h}, 0.01) for h in (2e-6, 1e-6)
    )
    assert np.abs(2 * fine - coarse - exact).max() <= bound


def test_lugre_equals_a_stiff_solver():
    Ts = 0.02
    p = parameters("lugre", SJ, Ts)
    op = 50.0 + np.concatenate([np.linspace(0, 8, 40), np.full(15, 8.0), np.linspace(8, -4, 40)])

    def slopes(t, y, before, now):
        x, v, z = y
        slip = v - abs(v) * z * p.s0 / (p.Fc + (p.Fs - p.Fc) * np.exp(-((v / p.vs) ** 2)))
        force = (before + (now - before) * t / Ts) / 100 * p.k * p.stroke
        return [v, (force - p.k * x - p.s0 * z - p.s1 * slip - p.Fv * v) / p.m, slip]

    y, before, reference = [p.stroke / 2, 0.0, 0.0], op[0], []
    for now in op:
        y = solve_ivp(
            slopes, (0, Ts), y, args=(before, now), method="LSODA", rtol=1e-9, atol=1e-13
        ).y[:, -1]
        before = now
        reference.append(100 * y[0] / p.stroke)
    assert np.abs(valve_response("lugre", op, SJ, Ts) - reference).max() < 1e-3
