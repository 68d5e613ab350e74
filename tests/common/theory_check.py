"""Theory against simulation of random loops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.theory.basin import kick_min
from simbench.theory.cycle import exact_cycle
from simbench.theory.half_cycle import half_cycles
from simbench.theory.sampled import sampled_loop, ultimate_gain
from simbench.theory.tables import refined

S = 5.0  # cycles scale with S; J/S, Kc/Ku, Ti/T, Td/T and Ts/Td decide
LONGEST = 5_000_000  # samples


@dataclass(frozen=True)
class Errors:
    """Theory against simulation over many loops."""

    table: np.ndarray  # (2, 2) loops by [predicted, cycled], 0 = no, 1 = yes
    # period, amplitude: (n,) relative errors of the prediction, one per simulated cycle
    period: np.ndarray
    amplitude: np.ndarray


def drawn_loops(seed: int) -> Iterator[Loop]:
    """Yield random loops without end.

    Both plants, P and PI; Td/T (integrating: Td/Ti) 0.05..2 and Ts Td/50..Td/3 evenly in their
    logarithms, J/S 0.1..1.5, Kc 0.1..0.9 of the ultimate gain, Ti/T 0.3..3. Integrating loops with
    Td > Ti have no stable tuning: there the gain refers to P control, and the cycle runs between
    the limits of OP.
    """
    rng = np.random.default_rng(seed)
    while True:
        integrating, pi = rng.random(2) < 0.5
        ratio, per_delay = np.exp(rng.uniform(np.log([0.05, 3]), np.log([2, 50])))
        Ti = 10.0 if integrating else 10.0 * np.exp(rng.uniform(np.log(0.3), np.log(3)))
        share, J = rng.uniform([0.1, 0.1], [0.9, 1.5])
        yield tuned(
            bool(integrating), 10 * ratio, Ti if pi else None, share, J, 10 * ratio / per_delay
        )


def tuned(
    integrating: bool, Td: float, Ti: float | None, share: float, J_over_S: float, Ts: float
) -> Loop:
    """Return a loop (T = 10 s, S = 5 %) whose Kc is `share` of its ultimate gain; of P's where PI
    has none.
    """
    plant = (
        {"type": "integrating", "K": 0.1} if integrating else {"type": "foptd", "K": 1.0, "T": 10.0}
    )
    table: dict[str, Any] = {
        "plant": {**plant, "Td": Td},
        "controller": (
            {"type": "P", "Kc": 1.0} if Ti is None else {"type": "PI", "Kc": 1.0, "Ti": Ti}
        ),
        "valve": {"model": "choudhury", "S": S, "J": J_over_S * S},
        "sampling": {"Ts": Ts},
    }
    limit = ultimate_gain(sampled_loop(Loop.from_table(table)))
    if limit is None:
        table["controller"] = {"type": "P", "Kc": 1.0}
        limit = ultimate_gain(sampled_loop(Loop.from_table(table)))
        table["controller"] = {"type": "PI", "Kc": 1.0, "Ti": Ti}
    assert limit is not None  # a sampled loop with a pole has one
    return Loop.from_table(table).with_("controller.Kc", share * limit)


def simulated_cycle(loop: Loop, periods: int = 40, **start: Any) -> tuple[float, float] | None:
    """Simulate a loop until its last `periods` periods are steady and measure them.

    `periods`: length of the tail, after a transient of 90 periods.

    None when the valve stops reversing, or swings by less than J/2 (J = 0: S/200), or fades.
    """
    sampled = sampled_loop(loop)
    wanted, n = 2 * (periods + 90), 20_000
    while True:
        record = simulate(loop.with_("sampling.n", n), **start).record
        mv = record.mv
        assert mv is not None
        moves = np.nonzero(np.abs(np.diff(mv)) > 1e-9)[0] + 1  # rounding moves a valve too
        ways = np.sign(mv[moves] - mv[moves - 1])
        turns = moves[1:][ways[1:] != ways[:-1]]
        rests = np.ptp(mv[n // 2 :]) < sampled.least_swing and n > 2 * sampled.patience
        if turns.size > wanted or rests or n >= LONGEST:
            break
        n *= 4
    if turns.size <= wanted or rests:
        return None
    turns = turns[-2 * periods - 1 :]
    swings = np.abs(np.diff(mv[turns - 1]))
    third = swings.size // 3
    if np.median(swings) < sampled.least_swing or np.median(swings[-third:]) < 0.8 * np.median(
        swings[:third]
    ):
        return None
    parts = [record.op[a : b + 1] for a, b in pairwise(turns)]
    tops = [part.max() if mv[a] > mv[a - 1] else part.min() for a, part in zip(turns[:-1], parts)]
    return 2 * float(np.diff(turns).mean()) * record.Ts, float(np.abs(np.diff(tops)).mean()) / 2


def starts(loop: Loop) -> Iterator[tuple[Loop, dict[str, float]]]:
    """Yield nine ways to set a loop moving: kicks, load steps and set-point steps, in multiples of
    the break-away.
    """
    fs = sampled_loop(loop).fs
    table, Ts = loop.to_table(), loop.sampling.Ts
    for size in (1.05, 1.6, 3.0):
        yield loop, {"kick": size * fs}
    for size in (0.5, 1.0, 1.5, 3.0):
        step = {"type": "ramp", "amplitude": size * fs, "period": Ts, "at": "input"}
        yield Loop.from_table({**table, "disturbance": [step]}), {}
    for size in (0.6, 2.0):
        to = loop.setpoint.value + size * fs / loop.controller.Kc
        yield (
            Loop.from_table(
                {**table, "setpoint": {"value": loop.setpoint.value, "steps": [[Ts, to]]}}
            ),
            {},
        )


def predictions(loops: int, seed: int) -> tuple[Errors, Errors]:
    """Compare exact cycles with simulations of random loops, none dropped.

    Of `exact_cycle`, and of the switching times alone (`half_cycles`, no marching).
    """
    tables = np.zeros((2, 2, 2), dtype=int)
    errors: tuple[list, list] = ([], [])
    for _, loop in zip(range(loops), drawn_loops(seed)):
        sampled = sampled_loop(loop)
        cycle = exact_cycle(sampled)
        steady = [h for h in half_cycles(sampled) if h.stable][:1]
        found = [
            [] if cycle is None else [(cycle.period, cycle.amplitude)],
            [(2 * h.samples * sampled.Ts, h.amplitude) for h in steady],
        ]
        simulated = [c for moved, start in starts(loop) if (c := simulated_cycle(moved, **start))]
        for i in range(2):
            tables[i, int(bool(found[i])), int(bool(simulated))] += 1
            errors[i].extend(np.abs(np.array(c) / found[i][0] - 1) for c in simulated if found[i])
    columns = [np.array(e).reshape(-1, 2).T for e in errors]
    return Errors(tables[0], *columns[0]), Errors(tables[1], *columns[1])


def kicks(loops: int, seed: int) -> int:
    """Simulate 1.02 and 0.9 times the predicted smallest kick of random loops that have one; return
    how many the larger starts and the smaller does not.
    """
    right = tried = 0
    draw = drawn_loops(seed)
    while tried < loops:
        loop = next(draw)
        sampled = sampled_loop(loop)
        cycle = exact_cycle(sampled)
        kick = None if cycle is None else kick_min(sampled, cycle)
        if kick is None:
            continue
        tried += 1
        above, below = (simulated_cycle(loop, kick=factor * kick) for factor in (1.02, 0.9))
        right += above is not None and below is None
    return right


def existence_pi(loops: int, seed: int) -> Errors:
    """Compare the existence condition of self-regulating PI loops with a dead-band with simulation.

    `loops`: how many: Td/T 0.05..2, Ti/T 0.3..3 and Td/Ts 5..20 evenly in their logarithms, Kc
    0.1..0.9 of the ultimate gain.

    Of `refined`; periods and amplitudes those of the exact cycle.
    """
    rng = np.random.default_rng(seed)
    table = np.zeros((2, 2), dtype=int)
    errors = []
    for _ in range(loops):
        Td, Ti, per_delay = np.exp(rng.uniform(np.log([0.5, 3.0, 5.0]), np.log([20.0, 30.0, 20.0])))
        loop = tuned(False, Td, Ti, rng.uniform(0.1, 0.9), 0.0, Td / per_delay)
        sampled = sampled_loop(loop)
        cycle = exact_cycle(sampled)
        simulated = [c for moved, start in starts(loop) if (c := simulated_cycle(moved, **start))]
        table[int(refined(sampled, cycle)), int(bool(simulated))] += 1
        if cycle is not None:
            errors.extend(
                np.abs(np.array(c) / (cycle.period, cycle.amplitude) - 1) for c in simulated
            )
    return Errors(table, *np.array(errors).reshape(-1, 2).T)
