"""A valve of limited speed is found by OP and MV, with its speeds; one that lags, sticks, stands or
follows OP is none.
"""

from __future__ import annotations

import numpy as np
import pytest

from simbench import diagnose
from simbench.detectors.record import LoopRecord
from simbench.gap.likelihood.kernels import limit_rate
from simbench.gap.likelihood.valve_map import MapSearch
from simbench.gap.stiction.slow import slow_valve
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TS = 2.0


def follow(op, up, down):
    """The definition, sample by sample: towards OP, no faster than a limit."""
    mv = [op[0]]
    for target in op[1:]:
        mv.append(min(target, mv[-1] + up) if target > mv[-1] else max(target, mv[-1] - down))
    return np.array(mv)


def moving(seed, n=2000):
    """An OP (%) that moves slowly, and now and then by much."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.normal(0.0, 8.0, n // 100), 100)
    return 50.0 + steps + np.cumsum(rng.normal(0.0, 0.2, n)) * 0.5


@pytest.mark.parametrize("seed", range(8))
def test_both_speeds_are_found_with_how_far_the_valve_is_off(seed):
    rng = np.random.default_rng([seed, 1])
    op = moving(seed)
    up, down = np.exp(rng.uniform(np.log(0.1), np.log(1.5), 2))
    mv = follow(op, up, down)
    assert np.allclose(limit_rate(op, up, down), mv)
    _, slow = slow_valve(MapSearch(op, mv + rng.normal(0.0, 0.05, op.size), TS, op))
    assert (slow.opening, slow.closing) == pytest.approx((up / TS, down / TS), rel=0.1)
    assert slow.far == pytest.approx(np.abs(op - mv).max(), rel=0.05)
    assert slow.share == pytest.approx(np.mean(op != mv), abs=0.03)


@pytest.mark.parametrize("slowness", [3.0, 0.0])
def test_a_stem_that_stays_behind_op_is_the_cause_and_the_unit_of_mv_is_not(slowness):
    loop = {
        "plant": {"type": "foptd", "K": 1, "T": 40, "Td": 5},
        "controller": {"type": "PI", "Kc": 2.0, "Ti": 40},
        "valve": {"model": "ideal"},
        "sampling": {"Ts": 2, "n": 1500},
        "noise": {"std": 0.1},
        "setpoint": {"value": 50, "steps": [[300 * k, 50 + 6 * (-1) ** k] for k in range(1, 9)]},
        "effect": [{"name": "slew_limit", "slowness": slowness}],
    }
    run = simulate(Loop.from_table(loop), 1)
    record = LoopRecord(**{k: getattr(run.record, k) for k in ("op", "pv", "sp")}, Ts=TS, mv=run.mv)
    said = diagnose(record)
    assert said.verdict == "no_stiction"
    assert (said.conclusion.cause == "slow valve") == (slowness > 0.0)
    assert "not written in the unit of OP" not in said.conclusion.reason
