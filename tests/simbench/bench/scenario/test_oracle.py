"""The oracle is right about any load, and seldom alarms under noise alone."""

import numpy as np
import pytest
from scipy.signal import lfilter

from simbench.bench.scenario import oracle as oracle_room
from simbench.bench.scenario.oracle import judge_oracle
from simbench.detectors.compiled import compiled
from simbench.detectors.signal.fits.hammerstein_kernels import Stretch, Valves
from simbench.detectors.signal.stiction_map import valve_position
from simbench.loop.resolve import resolve_loop
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, Scenario
from simbench.valve.maps import at_rest

FOPTD = {"type": "foptd", "K": 1.5, "T": 10, "Td": 2.3}
INTEGRATING = {"type": "integrating", "K": 0.1, "Td": 1.7}


def loop(valve, plant=FOPTD, noise=0.0, disturbance=(), step=5.0, n=800):
    return Loop.from_table(
        {
            "plant": plant,
            "controller": {"type": "PI", "Kc": 0.8, "Ti": 20},
            "valve": valve,
            "sampling": {"Ts": 1, "n": n},
            "noise": {"std": noise},
            "setpoint": {"value": 50, "steps": [[10, 50 + step]] if step else []},
            "disturbance": list(disturbance),
        }
    )


def oracle(loop, seed=0):
    return judge_oracle(Scenario(loop=loop, seed=seed), simulate(loop, seed))


LOADS = [
    (),
    ({"type": "sine", "amplitude": 2, "period": 60, "at": "output"},),
    ({"type": "random_walk", "amplitude": 2, "period": 60, "at": "input"},),
]
STICKY = [
    {"model": "choudhury", "S": 5, "J": 2},
    {"model": "choudhury", "S": 3, "J": 3},
    {"model": "deadband", "S": 4},
    {"model": "kano", "S": 5, "J": 1},
]


@pytest.mark.parametrize("plant", [FOPTD, INTEGRATING])
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_right_about_healthy_and_sticky_valves_under_any_load(plant, load, noise):
    answer = oracle(loop({"model": "ideal"}, plant, noise, load))
    assert answer.verdict == "no_stiction"
    assert "the ideal valve is likelier" in answer.reason
    for valve in STICKY:
        answer = oracle(loop(valve, plant, noise, load))
        assert answer.verdict == "stiction"
        assert "the sticky valve is likelier" in answer.reason


def response(setup, inflow):
    """Return PV's answer to an inflow, both as deviations."""
    b, a, late = oracle_room._transfer_function(setup)
    return np.append(np.zeros(late), lfilter(b, a, inflow[: inflow.size - late]))


@pytest.mark.parametrize("plant", [FOPTD, INTEGRATING])
def test_the_kernel_has_the_squares_of_one_valve_after_the_other(plant):
    sticky = loop(STICKY[0], plant, noise=0.2, disturbance=LOADS[2], n=120)
    run, setup = simulate(sticky, 3), resolve_loop(sticky, 3)
    rng = np.random.default_rng(0)
    S = np.append(0.0, rng.uniform(0.1, 40.0, 70))
    J = S * rng.uniform(0.0, 1.3, S.size)
    op, left = np.array(run.record.op), run.record.pv - setup.pv0 - run.load_out
    slowly = []
    for s, j in zip(S, J, strict=True):
        mv = valve_position(op, s, j, at_rest(setup.op0))
        left_over = left - response(setup, mv - setup.op0 + run.load_in)
        slowly.append(left_over @ left_over)
    none = np.zeros(S.size)
    record = Stretch(np.append(setup.op0, op), left, 1, 0, 0, op.size, 1.0, 0.0, 100.0)
    asked = (record, Valves(none, S, J, none, none, none, none), np.array(run.load_in))
    plain, fast = np.empty(S.size), np.empty(S.size)
    oracle_room.squares_left(*asked, *oracle_room._transfer_function(setup), plain)
    compiled(oracle_room.squares_left)(*asked, *oracle_room._transfer_function(setup), fast)
    assert fast.tolist() == plain.tolist()
    assert fast == pytest.approx(slowly, rel=1e-9)


def test_band_and_jump_are_estimated():
    verdict = oracle(loop(STICKY[0], noise=0.2))
    assert verdict.S == pytest.approx(5, abs=0.3)
    assert verdict.J == pytest.approx(2, abs=0.3)


def test_false_alarms_under_noise_are_rare():
    # the two fitted numbers cost ln n: chance alone seldom earns that
    wrong = [
        oracle(loop({"model": "ideal"}, noise=0.5, n=300), seed).verdict == "stiction"
        for seed in range(40)
    ]
    assert sum(wrong) <= 2
