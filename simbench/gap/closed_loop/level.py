"""Adjust the operating point of a corrected loop until its simulations have the mean OP and PV of
the record.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.situation import Situation
from simbench.loop.simulate import simulate
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

RUNS = (
    8  # of each loop, each under a load of its own: what a mean over them misses is a third of it
)
_ROUNDS = 4  # times that the operating point is moved at most
_CLOSE = 0.02  # share of the record's standard deviation, at which the level is reached
WITHIN = (1.0, 99.0)  # % of travel, where the operating point may lie
RUNAWAY = 1e9  # PV units; far beyond any transmitter, far below what overflows a feature


def level(situation: Situation, loop: Loop, kick: float, seed: int = 0) -> Loop:
    """Return the loop with the operating point at which the means of its runs are the record's; the
    nearest one tried.
    """
    # The record's means and standard deviations
    real = np.array([situation.op, situation.record.pv])
    wide = np.maximum(real.std(axis=1), 1e-9)
    bias_only = loop.controller.Ti is None and not loop.plant.integrating
    best = loop
    least = np.inf

    # Runs of the loop, and how far their means are off
    for _ in range(_ROUNDS):
        runs = run_with_seeds(loop, seed, RUNS, kick)
        if runs is None:
            break
        means = np.mean([(run.op.mean(), run.pv.mean()) for run in runs], axis=0)
        away = real.mean(axis=1) - means
        off = float(np.max(np.abs(away) / wide))

        # The best so far stays; near enough is done
        if off < least:
            best = loop
            least = off
        if off < _CLOSE:
            break

        # The operating point moves by what is missing
        d_op, d_pv = map(float, away)
        at = loop.operating_point
        op0 = at.op0 + d_op
        if bias_only:  # without integral action PV rests where it likes
            op0 += loop.controller.sign * loop.controller.Kc * d_pv
            loop = loop.with_(
                "operating_point.pv0", loop.pv0 + d_pv - loop.plant.K * (d_op + at.op0 - op0)
            )
        loop = loop.with_("operating_point.op0", float(np.clip(op0, *WITHIN)))
    return best


def run_with_seeds(loop: Loop, seed: int, count: int, kick: float = 0.0) -> list[LoopRecord] | None:
    """Return the records of a loop under successive seeds; None where it cannot be simulated or
    runs away.
    """
    try:
        runs = [simulate(loop, seed=seed + i, kick=kick).record for i in range(count)]
    except UserError:
        return None
    return runs if max(float(np.abs(run.pv).max()) for run in runs) < RUNAWAY else None


def moved(loop: Loop, kick: float) -> Loop:
    """Return a loop whose OP is moved by so many % in its first sample."""
    if not kick:
        return loop
    move = {"amplitude": kick, "period": loop.sampling.Ts, "at": "op"}
    # ahead of the others: an echo of a valve's motion must be the last
    return loop.replace(disturbance=(Part(name="ramp", parameters=move),) + loop.disturbance)


def kick_of(p: Mapping[str, Any]) -> float:
    """Return the offset of OP (%) that starts a cycle under an effect of these numbers: only a
    valve that jumps needs one.
    """
    if "J" in p:
        return float(p["S"])
    return 0.0
