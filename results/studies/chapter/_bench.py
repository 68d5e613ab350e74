"""A small bench for the rows: some loops, their cycles, and the records of sticky and of healthy
ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.figures._cycles import sustained_cycle
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.theory.cycle import ExactCycle, exact_cycle
from simbench.theory.sampled import sampled_loop

# Td/T, Kc over the ultimate gain, Ti/T of twelve self-regulating loops; Td, K Kc Td, Ti/Td of six
# integrating ones
SELF = [(r, g, i) for r in (0.2, 0.5, 1.0) for g in (0.2, 0.4) for i in (0.8, 1.2)]
LEVELS = [(Td, g, i) for Td in (1.0, 2.0) for g, i in ((0.2, 20.0), (0.3, 15.0), (0.4, 30.0))]


def loops(
    S: float = 5.0,
    J: float = 2.0,
    *,
    process: str = "foptd",
    controller: str = "PI",
    model: str = "choudhury",
    Ts: float = 0.5,
    n: int = 1500,
    **more: Any,
) -> Iterator[Loop]:
    """Yield the loops of the bench with one valve; `more` are further sections of a loop file."""
    for a, g, i in SELF if process == "foptd" else LEVELS:
        if process == "foptd":
            plant = {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 10.0 * a}
            Kc, Ti = g * 0.5 * np.pi / a, 10.0 * i
        else:
            plant = {"type": "integrating", "K": 0.1, "Td": a}
            Kc, Ti = g / (0.1 * a), i * a
        parts = {"type": controller, "Kc": Kc} | ({"Ti": Ti} if controller == "PI" else {})
        valve = {"model": model} | ({"S": S, "J": J} if model != "ideal" else {})
        yield Loop.from_table(
            {
                "plant": plant,
                "controller": parts,
                "valve": valve,
                "sampling": {"Ts": Ts, "n": n},
                **more,
            }
        )


def cycle_of(loop: Loop) -> ExactCycle | None:
    """Return the loop's limit cycle without noise, or None."""
    return exact_cycle(sampled_loop(loop))


def record_of(
    loop: Loop, noise: float = 0.0, seed: int = 0, periods: int = 15, **about: Any
) -> LoopRecord:
    """Return the loop on its limit cycle, with white noise on PV of so many standard deviations of
    it.
    """
    cycle = sustained_cycle(loop, periods)
    pv = cycle["PV - SP"].to_numpy()
    pv = pv + noise * pv.std() * np.random.default_rng(seed).standard_normal(pv.size)
    process = "integrating" if loop.plant.type == "integrating" else "self-regulating"
    known = {"process": process, "op_span": (0.0, 100.0), **about}
    return LoopRecord(
        op=cycle["OP (%)"].to_numpy(),
        pv=50.0 + pv,
        mv=cycle["MV (%)"].to_numpy(),
        Ts=loop.sampling.Ts,
        **known,
    )


def healthy(
    noise: float = 0.0, lag: float | None = None, period: float = 40.0
) -> Iterator[LoopRecord]:
    """Yield the loops with an ideal valve under a sine at the plant's input, or under another
    sticky loop's PV through a lag.
    """
    wave = {"type": "sine"} if lag is None else {"type": "propagated", "lag": lag}
    for seed, loop in enumerate(
        loops(
            model="ideal", disturbance=[{**wave, "amplitude": 3.0, "period": period, "at": "input"}]
        )
    ):
        record = simulate(loop, seed).record
        pv = record.pv + noise * record.pv.std() * np.random.default_rng(seed).standard_normal(
            record.n
        )
        yield LoopRecord(
            op=record.op, pv=pv, Ts=record.Ts, process="self-regulating", op_span=(0.0, 100.0)
        )
