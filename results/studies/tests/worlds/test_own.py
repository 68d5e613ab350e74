"""The generator: its loop is right, and its faults show at full strength."""

import math
from dataclasses import replace

import numpy as np
import pytest

from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds.own import drawing, faults, items, loops, sizes
from results.studies.worlds.own import simulator as sim

RNG = np.random.default_rng


def plain(plant="foptd", controller="PI", **changes):
    """A quiet loop that logs everything on time, in the contract's PI form."""
    case = drawing.draw(RNG(7), plant=plant, sp_moves=True, mv=True)
    Ti = case.Ti if controller == "PI" else 0.0
    quiet = dict.fromkeys(("load_std", "mv_noise", "log_is_late", "play", "smooth_gap"), 0.0)
    quiet |= {"controller": controller, "Ti": Ti, "noise_std": 1e-9 * case.unit, "n": 600}
    return replace(case, **quiet, form=sim.VELOCITY, integral=sim.BACKWARD, **changes)


def sampled_twin(case, setup):
    """The contract's loop, one plain step per sample: exact plant under a held valve, whole-sample
    dead time, velocity PI.
    """
    d = round(case.Td / case.Ts)
    moved = [case.op0] * (d + 1)
    a = math.exp(-case.Ts / case.T)
    x, u, before = 0.0, case.op0, None
    op, pv = [], []
    for r in setup.sp:
        y = case.pv0 + x
        e = r - y
        before = e if before is None else before
        if case.controller == "P":
            u = case.op0 + case.sign * case.Kc * e
        else:
            u += case.sign * case.Kc * (e - before + case.Ts / case.Ti * e)
        before, u = e, min(max(u, 0.0), 100.0)
        op.append(u)
        pv.append(y)
        moved = [u, *moved[:-1]]
        v = moved[d] - case.op0
        x = a * x + (1 - a) * case.K * v if case.plant == "foptd" else x + case.Ts * case.K * v
    return np.array(op), np.array(pv)


@pytest.mark.parametrize("plant", ["foptd", "integrating"])
@pytest.mark.parametrize("controller", ["PI", "P"])
def test_the_plain_loop_is_the_sampled_loop_of_the_contract(plant, controller):
    case = plain(plant, controller)
    case = replace(case, Td=3 * case.Ts)
    run = loops.simulate(case, 0)
    op, pv = sampled_twin(case, loops.prepare(case, 0))
    np.testing.assert_allclose(run.op, op[case.warm_up :], atol=1e-5)
    np.testing.assert_allclose(run.pv, pv[case.warm_up :], atol=1e-5 * case.unit)


def test_a_late_log_shows_op_one_sample_older():
    case = plain()
    now, late = loops.simulate(case, 0), loops.simulate(replace(case, log_is_late=True), 0)
    np.testing.assert_array_equal(late.op[1:], now.op[:-1])
    np.testing.assert_array_equal(late.pv, now.pv)


@pytest.mark.parametrize("friction", [sim.KARNOPP, sim.STRIBECK])
def test_the_stem_breaks_away_at_half_s_plus_j_and_slips_by_j(friction):
    S, J = 4.0, 1.5
    p = sim.Physics(friction=friction, fs=(S + J) / 2, fc=(S - J) / 2)
    x, w, moved_at = 50.0, 0.0, None
    for u in 50.0 + 1e-4 * np.arange(40_000):  # 0.1 % per 1000 sub-steps: quasi-static
        x, w = sim._stem(u, x, w, p, 1.0 / sim.SUBSTEPS)
        if w != 0.0 and moved_at is None:
            moved_at = u
        if w == 0.0 and moved_at is not None:
            break
    assert moved_at == pytest.approx(50 + (S + J) / 2, abs=0.01)
    # Stribeck's friction grows again as the stem slows down: it slips less far
    assert x - 50.0 == pytest.approx(J, abs=0.1 if friction == sim.KARNOPP else 0.3)


@pytest.mark.parametrize("name", [*WORLD_EFFECTS, *faults.FOREIGN])
def test_every_fault_shows_at_full_strength_and_can_be_tested_in_a_slow_loop(name):
    plant = faults.NEEDS_PLANT.get(name, "foptd")
    case = replace(drawing.draw(RNG(4), plant=plant, sp_moves=True), play=0.0)
    habit = sizes.Habit(case.op0 - 10, case.op0 + 10, 4.0, 2.0 * case.unit)
    size = sizes.scale(name, case, habit, RNG(1))
    weak, strong = size(0.0), size(1.0)
    if name in WORLD_EFFECTS:
        known = WORLD_EFFECTS[name].parameters
        for k, v in [*weak.items(), *strong.items()]:
            assert isinstance(v, str) or known[k].low <= v <= known[k].high
    fault = faults.fault(name, strong)
    a, b = loops.simulate(case, 3), loops.simulate(case, 3, (fault,))
    assert max(np.abs(a.op - b.op).max(), np.abs(a.pv - b.pv).max() / case.unit) > 0.05
    slow = replace(case, speed=400.0 * case.Ts, n=100)
    assert np.isfinite(loops.simulate(slow, 3, (fault,)).pv).all()


def test_the_nominal_plant_is_within_ten_percent_and_a_mismatch_counts_from_it_exactly():
    for i in range(40):
        case = drawing.draw(RNG(i))
        K, T, Td = case.nominal
        logged = case.Td - case.Ts * case.log_is_late
        for nominal, true in ((K, case.K), (T, case.T), (Td, logged)):
            assert 0.8999 <= nominal / true <= 1.1001
    exact = items._named(case, ("gain_mismatch",))
    assert exact.nominal[0] == case.K
    assert exact.nominal[1:] == case.nominal[1:]
