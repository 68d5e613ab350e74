"""Loops drawn at random: every number within its range, both ends of the range met, and the answer
kept apart.
"""

import numpy as np
import pytest
from effect_draws import DRAWS
from random_case import random_case, random_effect, random_loop

from detectors.errors import ParameterError
from scenarios.spec import Loop
from simbench.gap.effects import recogniser


@pytest.fixture(scope="module")
def loops():
    return [random_loop(np.random.default_rng(seed)) for seed in range(400)]


def fills(values, low, high, log=False):
    """Return whether values lie within a range and come within a fortieth of either end."""
    x, (a, b) = (np.log(values), np.log([low, high])) if log else (np.asarray(values), (low, high))
    near = 0.025 * (b - a)
    assert a - 1e-9 <= x.min() <= a + near, (np.min(values), low)
    assert b - near <= x.max() <= b + 1e-9, (np.max(values), high)


def test_every_number_of_a_loop_fills_its_range(loops):
    vessels = [x for x in loops if x.plant.type == "integrating"]
    assert len(vessels) / len(loops) == pytest.approx(0.4, abs=0.06)
    assert {x.sampling.Ts for x in loops} == {0.5, 1.0, 2.0, 5.0, 10.0}
    firsts = [x for x in loops if x.plant.type == "foptd"]
    fills([x.plant.T / x.sampling.Ts for x in firsts], 6.0, 50.0, log=True)
    fills([x.plant.Td / x.plant.T for x in firsts], 0.05, 0.6)
    fills([abs(x.plant.K) for x in firsts], 0.3, 3.0, log=True)
    fills([x.sampling.n for x in loops], 1200, 3000)
    fills([x.setpoint.value for x in loops], 30.0, 70.0)
    fills([x.operating_point.op0 for x in loops], 35.0, 65.0)
    fills([x.noise.std / abs(x.plant.K) for x in firsts], 0.03, 0.4, log=True)
    fills([x.disturbance[0].parameters["amplitude"] for x in loops], 0.1, 1.2, log=True)
    fills([x.disturbance[0].parameters["period"] / x.plant.T for x in firsts], 0.2, 3.0)
    for x in loops:
        assert x.operating_point.pv0 == x.setpoint.value
        assert x.controller.sign == np.sign(x.plant.K)


def test_a_loop_is_tuned_for_a_time_constant_that_is_drawn(loops):
    # direct synthesis (Skogestad 2003): Kc = T/K/(closed + Td)
    firsts = [x for x in loops if x.plant.type == "foptd"]
    closed = [x.plant.T / abs(x.plant.K) / x.controller.Kc - x.plant.Td for x in firsts]
    fills([c / x.plant.T for c, x in zip(closed, firsts)], 0.35, 1.0)
    for x in firsts:
        # four times what is drawn and Td is always more
        assert x.controller.Ti == x.plant.T
    for x in loops:
        if x.plant.type == "integrating":
            reach = 1.0 / abs(x.plant.K) / x.controller.Kc
            assert x.controller.Ti == pytest.approx(4.0 * reach)
            # slower than twice the dead time
            assert reach > 2.0 * x.plant.Td


def test_vessels_fill_their_ranges_in_units_of_the_time_they_were_drawn_with(loops):
    vessels = [x for x in loops if x.plant.type == "integrating"]
    # T itself is not kept; in it, reach = 2 Td + 0.1 .. 0.6 and Td = 0.05 .. 0.6
    ratio = [1.0 / abs(x.plant.K) / x.controller.Kc / x.plant.Td for x in vessels]
    assert 2.0 + 0.1 / 0.6 < min(ratio) < 2.5
    assert 5.0 < max(ratio) < 2.0 + 0.6 / 0.05
    gain = [abs(x.plant.K) * x.plant.Td for x in vessels]
    assert 0.3 * 0.05 < min(gain) < 0.05
    assert 1.0 < max(gain) < 3.0 * 0.6


def test_set_points_step_in_two_loops_of_three_two_to_eight_times(loops):
    moving = [x for x in loops if x.setpoint.steps]
    assert len(moving) / len(loops) == pytest.approx(0.65, abs=0.05)
    assert {len(x.setpoint.steps) for x in moving} == set(range(2, 9))
    shares = [t / (x.sampling.n * x.sampling.Ts) for x in moving for t, _ in x.setpoint.steps]
    fills(shares, 0.0, 1.0)
    for x in moving:
        assert [t for t, _ in x.setpoint.steps] == sorted(t for t, _ in x.setpoint.steps)
    fills(
        [
            (v - x.setpoint.value) / x.plant.K
            for x in moving
            if x.plant.T
            for _, v in x.setpoint.steps
        ],
        -6.0,
        6.0,
    )


@pytest.mark.parametrize("integrating", [False, True])
def test_an_effect_is_drawn_plain_but_not_gross(loops, integrating):
    some = [x for x in loops if (x.plant.type == "integrating") == integrating][:40]
    shares = []
    for i, x in enumerate(some):
        tau = random_effect("valve_lag", x, np.random.default_rng(i))["tau"]
        # an integrating plant's pace is a quarter of the integral time
        pace = (x.controller.Ti / 4 if integrating else x.plant.T) + x.plant.Td
        shares.append(np.log(tau / pace / 0.03) / np.log(8.0 / 0.03))
    assert 0.45 <= min(shares) < 0.5
    assert 0.7 < max(shares) <= 0.75


@pytest.mark.parametrize("integrating", [False, True])
def test_an_effect_is_measured_by_the_loop_it_acts_in(monkeypatch, loops, integrating):
    seen = []
    monkeypatch.setitem(DRAWS, "any", lambda y, rng: seen.append(y) or (lambda x: {"x": x}))
    loop = next(x for x in loops if (x.plant.type == "integrating") == integrating)
    p = random_effect("any", loop, np.random.default_rng(0))
    (y,) = seen
    T = loop.controller.Ti / 4 if integrating else loop.plant.T
    assert (y.lag, y.pace) == pytest.approx((T + loop.plant.Td,) * 2)
    assert y.gain == pytest.approx(abs(loop.plant.K) * (T if integrating else 1.0))
    assert (y.noise, y.Td, y.integral) == (loop.noise.std, loop.plant.Td, True)
    assert y.record.n == loop.sampling.n
    assert 0.45 <= p["x"] <= 0.75
    if integrating:
        table = loop.to_table()
        table["controller"] = {k: v for k, v in table["controller"].items() if k != "Ti"} | {
            "type": "P"
        }
        random_effect("any", Loop.from_table(table), np.random.default_rng(0))
        # a P controller has no integral time to go by
        assert (seen[1].lag, seen[1].integral) == (pytest.approx(25.0 + loop.plant.Td), False)


def test_an_effect_that_nobody_can_draw_is_refused(loops):
    with pytest.raises(ParameterError, match="'strange': nobody said how to draw it"):
        random_effect("strange", loops[0], np.random.default_rng(0))


@pytest.fixture(scope="module")
def cases():
    return [random_case(seed) for seed in range(60)]


def test_the_baseline_is_ten_percent_off_and_knows_of_no_load(cases):
    off = {name: [] for name in ("K", "Td", "T")}
    for case in cases:
        true, said = case.truth.plant, case.baseline.plant
        for name, seen in off.items():
            if getattr(true, name) is not None:
                seen.append(getattr(said, name) / getattr(true, name))
        assert not case.baseline.disturbance
        assert not case.baseline.effect
        assert case.truth.disturbance
        assert case.baseline.controller == case.truth.controller
        assert case.record.mv is None
    for seen in off.values():
        assert 0.9 <= min(seen) < 0.92
        assert 1.08 < max(seen) <= 1.1
    assert random_case(3, mv=True).record.mv is not None


def test_a_case_is_a_function_of_its_seed_and_holds_what_was_asked():
    one, again, other = (
        random_case(4, ("deadband",)),
        random_case(4, ("deadband",)),
        random_case(5, ("deadband",)),
    )
    assert one.truth == again.truth
    assert np.array_equal(one.record.pv, again.record.pv)
    assert one.truth != other.truth
    assert one.effects == tuple(e.name for e in one.truth.effect) == ("deadband",)


def test_only_a_plant_with_a_time_constant_can_miss_it():
    assert recogniser("time_constant_mismatch").replaces == "T"
    assert {random_case(s, ("time_constant_mismatch",)).truth.plant.type for s in range(12)} == {
        "foptd"
    }
    assert {random_case(s, ("gain_mismatch",)).truth.plant.type for s in range(12)} == {
        "foptd",
        "integrating",
    }
