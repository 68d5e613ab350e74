"""Every effect: the vocabulary's words, nothing at strength zero, something at strength one, where
it claims to act.
"""

import numpy as np
import pytest

from simbench.loop.effects import EFFECTS, PLUGINS
from simbench.loop.effects.compression import swinging_door
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table({
    "plant": {"type": "foptd", "K": 1.5, "T": 20, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 18},
    "sampling": {"Ts": 1.0, "n": 600},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50, "steps": [[60, 53], [300, 48]]},
    "disturbance": [{"type": "random_walk", "amplitude": 2.0, "period": 200.0}],
})  # fmt: skip

STRONG = {
    "stiction": {"S": 4.0, "J": 1.5},
    "deadband": {"S": 4.0},
    "deadzone": {"D": 4.0},
    "valve_lag": {"tau": 8.0},
    "valve_characteristic": {"R": 8.0},
    "gain_mismatch": {"factor": 1.5},
    "time_constant_mismatch": {"factor": 1.5},
    "dead_time_mismatch": {"extra": 2.5},
    "extra_lag": {"tau": 8.0},
    "noise": {"factor": 3.0},
    "quantisation": {"step": 0.5},
    "sensor_lag": {"tau": 5.0},
    "compression": {"band": 0.4},
    "outliers": {"rate": 0.02, "size": 3.0},
    "drift": {"rate": 0.01, "walk": 0.05},
    "oscillation": {"amplitude": 3.0, "period": 60.0},
    "load_steps": {"rate": 0.01, "size": 4.0},
    "load_drift": {"rate": 0.01, "walk": 0.2},
    "saturation": {"lo": 49.0, "hi": 51.0},
    "detuning": {"Kc_factor": 1.8, "Ti_factor": 0.6},
    "error_deadband": {"width": 0.5},
    "op_quantisation": {"step": 0.5},
    "derivative_action": {"Td": 5.0, "filter": 1.0},
    "frozen_sensor": {"share": 0.2, "length": 15.0},
    "missed_executions": {"share": 0.2, "length": 15.0},
    "slew_limit": {"slowness": 4.0},
}


def with_effects(*effects):
    return Loop.from_table({**LOOP.to_table(), "effect": [{"name": n, **p} for n, p in effects]})


def same(a, b):
    return all(np.array_equal(getattr(a, s), getattr(b, s)) for s in ("op", "pv", "mv", "sp"))


@pytest.mark.parametrize("name", EFFECTS)
def test_strength_zero_changes_no_bit(name):
    effect = with_effects((name, EFFECTS[name].identity))
    assert same(simulate(effect, seed=3).record, simulate(LOOP, seed=3).record)


@pytest.mark.parametrize("name", EFFECTS)
def test_strength_one_changes_the_record_where_the_effect_says(name):
    plain, changed = (
        simulate(LOOP, seed=3).record,
        simulate(with_effects((name, STRONG[name])), seed=3).record,
    )
    assert not np.array_equal(plain.pv, changed.pv)
    assert np.array_equal(plain.op, changed.op) == (PLUGINS.load(name).ACTS == "record")


def test_two_effects_act_together():
    both = simulate(
        with_effects(("stiction", STRONG["stiction"]), ("quantisation", STRONG["quantisation"])),
        seed=3,
    ).record
    assert np.allclose(both.pv % 0.5, 0.0)
    assert np.count_nonzero(np.diff(both.mv) == 0) > both.n / 2


def test_noise_adds_in_quadrature():
    r = simulate(with_effects(("noise", {"factor": 0.0, "std": 0.3})), seed=5)
    assert np.array_equal(r.record.mv, simulate(LOOP.with_("noise.std", 0.3), seed=5).record.mv)


def test_no_sample_leaves_the_door():
    pv = np.cumsum(np.random.default_rng(0).standard_normal(500))
    rebuilt = swinging_door(pv, 0.7)
    assert np.abs(rebuilt - pv).max() <= 0.7 + 1e-9
    assert np.count_nonzero(np.abs(np.diff(rebuilt, 2)) > 1e-9) < 0.6 * pv.size
