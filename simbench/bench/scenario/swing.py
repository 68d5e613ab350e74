"""Let a healthy loop oscillate as sticky ones do, so that neither amplitude nor period tells them apart.

A load makes it oscillate, or its own tuning. Amplitude and period are those of a sticky valve's cycle in the same loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from scenarios.cell import Oscillation
from scenarios.spec import Loop, Noise
from simbench.loop import plant
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulate

_STEP = 0.98  # between periods at which a loop could oscillate
_DIGITS = 3  # ids must not hang on the last bits of a simulation
_WANDERS = 1.0  # periods after which a load's wandering has forgotten itself
# of a loop that oscillates by its tuning: how many gains are tried, and between which shares of the
# gain at which the loop alone neither grows nor fades; with noise it is a lower one
_TRIES, _SHARES = 12, (0.8, 1.01)
_LARGEST_KICK = (
    8.0  # OP stds of the wanted oscillation; a larger excitation would bring OP to its limits
)
# logarithm of the OP std in the last fifth of a record over that in the first: the first is taken at once,
# above the second no tuning is taken; nine in ten sticky loops of grid chapter have less than 0.2
_STEADY, _UNSTEADY = 0.1, 0.2
_UNLIKE = 0.5  # logarithm of the variance of OP over the wanted one: more in a loop whose valve is far from linear


class UnmatchedError(Exception):
    """A healthy loop that cannot oscillate as its sticky siblings do."""


@dataclass(frozen=True)
class Cycle:
    """How the sticky twin of a cell moves, or how a healthy loop should."""

    period: float  # of MV (s)
    pv_std: float  # of PV over the run but its first period (PV units)
    op_std: float  # of OP there (%)
    exists: bool  # False when no start set it going; then the other numbers are guesses


def significant(x: float) -> float:
    """Return a number rounded to 3 significant digits, so that ids do not hang on a simulation's last bits."""
    return float(f"{x:.{_DIGITS}g}")


def absolute_load(load: Mapping[str, Any], size: float, period: float) -> dict[str, Any]:
    """Return the table of a load whose amplitude is given in units of `size` and whose times in units of `period`."""
    scale = {"amplitude": size, "period": period, "lag": period, "start": period}
    return {k: significant(v * scale[k]) if k in scale else v for k, v in load.items()}


def wanted_cycle(cycle: Cycle, swing: Oscillation) -> Cycle:
    """Return how a healthy loop should oscillate: as a valve of another size would, at a period nearby."""
    sizes = {"pv_std": cycle.pv_std * swing.size, "op_std": cycle.op_std * swing.size}
    return replace(cycle, period=cycle.period * swing.period, **sizes)


def add_load(table: dict[str, Any], swing: Oscillation, cycle: Cycle) -> None:
    """Add the load that gives a healthy loop the period and the OP std of a cycle, and a slow one that makes it wander."""
    assert swing.load is not None
    load = absolute_load(
        {**swing.load, "amplitude": 1.0, "period": 1.0}, cycle.pv_std, cycle.period
    )
    table["disturbance"] = [*table.get("disturbance", []), load]
    for _ in range(2):  # the first is exact in a linear loop
        std = float(np.std(simulate(Loop.from_table(table, "cell")).record.op))
        load["amplitude"] = significant(load["amplitude"] * cycle.op_std / std)
    size, lasting = significant(swing.wander * cycle.op_std), significant(_WANDERS * cycle.period)
    table["disturbance"].append(
        {"type": "coloured", "at": "input", "amplitude": size, "period": lasting}
    )


def at_its_limit(loop: Loop, cycle: Cycle) -> tuple[Loop, Cycle]:
    """Return a loop with an ideal valve tuned so that it neither grows nor fades, and how it then oscillates.

    Its period is that of the cycle, or as near to it as the controller can make it from below.
    """
    Ts, setup, Ti = loop.sampling.Ts, plain_setup(loop, 0), loop.controller.Ti
    g = plant.sample(setup.num, setup.den, setup.Td, Ts)

    def answer(period: float) -> complex:  # -1/G of the sampled plant
        z = np.exp(2j * np.pi * Ts / period)
        return (
            -loop.controller.sign
            * z ** float(g.delay)
            * (z - g.A[0, 0])
            / ((g.B_old[0] / z + g.B_new[0]) * g.C[0])
        )

    # The loop oscillates where its controller answers with -1/G: a P controller at one period, a PI
    # controller at many. Of these only such that no more of the answer comes from the integral than
    # before: as much of the noise reaches OP then.
    least = 1.0 if Ti is None else 0.9 / math.hypot(1.0, cycle.period / (2.0 * math.pi * Ti))
    period = cycle.period if Ti is not None else max(cycle.period, 8.0 * loop.plant.Td)
    while period > 4.0 * Ts:
        needed = answer(period)
        if Ti is None and needed.imag >= 0.0:
            period = float(brentq(lambda x: answer(x).imag, period, period / _STEP))
            Kc = abs(answer(period))
            break
        # Kc + Ki z/(z - 1), two real equations; z/(z - 1) = 1/2 - i cot(pi Ts/period)/2
        Ki = -2.0 * needed.imag * math.tan(math.pi * Ts / period)
        Kc = needed.real - 0.5 * Ki
        if Ti is not None and Ki > 0.0 and Kc > least * abs(needed):
            loop = loop.with_("controller.Ti", significant(Kc * Ts / Ki))
            break
        period *= _STEP
    else:
        raise UnmatchedError
    own = replace(cycle, period=period, pv_std=cycle.op_std / abs(answer(period)))
    return loop.with_("controller.Kc", significant(Kc)), own


def steadied(loop: Loop, cycle: Cycle, seed: int) -> Loop:
    """Return a loop at its limit of stability with the gain and the excitation that give it the OP std of a cycle.

    Its answers to excitation and noise add up. A bisection finds the gain at which their sum is as wide at the record's end as
    at its beginning; for each gain the size of the excitation follows from the wanted std.
    """
    Kc, wanted = loop.controller.Kc, cycle.op_std**2 + (loop.controller.Kc * loop.noise.std) ** 2
    (lo, hi), share, least, found = _SHARES, 1.0, math.inf, loop
    for _ in range(_TRIES):
        tuned = loop.with_("controller.Kc", significant(share * Kc))
        noisy = simulate(_excited(tuned, 0.0), seed).record.op
        excited = simulate(_without_loads(tuned), seed).record.op
        excited = excited - excited.mean()
        size, half = float(np.var(excited)), float(np.mean((noisy - noisy.mean()) * excited))
        lacking = wanted - float(np.var(noisy))
        grows = lacking < 0.0  # noise and loads alone make it swing wider
        factor = (
            (math.sqrt(half**2 + lacking * size) - half) / size
            if size > 0.0 and not grows
            else math.inf
        )
        if factor * _excitation(tuned) < _LARGEST_KICK * cycle.op_std:
            op = noisy + factor * excited
            fifth = op.size // 5
            growth = math.log(float(np.std(op[-fifth:])) / float(np.std(op[:fifth])))
            grows = growth > 0.0
            if abs(growth) < least:
                candidate = _excited(tuned, significant(factor))
                off = math.log(
                    max(float(np.var(simulate(candidate, seed).record.op)), 1e-12) / wanted
                )
                if abs(off) < _UNLIKE:
                    least, found = abs(growth), candidate
        if least < _STEADY:
            break
        lo, hi = (lo, share) if grows else (share, hi)
        share = 0.5 * (lo + hi)
    if least > _UNSTEADY:
        raise UnmatchedError
    return found


def _excitation(loop: Loop) -> float:
    """Return about how far (%) the excitation at its start moves a loop's OP."""
    moved = [
        abs(value - loop.setpoint.value) * loop.controller.Kc
        for t, value in loop.setpoint.steps
        if t == 0.0
    ]
    return max(
        [
            0.0,
            *moved,
            *(float(d.parameters["amplitude"]) for d in loop.disturbance if d.name == "ramp"),
        ]
    )  # type: ignore[arg-type]


def _excited(loop: Loop, factor: float) -> Loop:
    """Return the loop with the excitation at its start multiplied by a factor."""
    rest, table = loop.setpoint.value, loop.to_table()
    table["setpoint"]["steps"] = [
        [t, rest + (v - rest) * factor if t == 0.0 else v] for t, v in loop.setpoint.steps
    ]
    for load in table["disturbance"]:
        load["amplitude"] *= factor if load["type"] == "ramp" else 1.0
    return Loop.from_table(table, "cell")


def _without_loads(loop: Loop) -> Loop:
    """Return the loop with nothing but the excitation at its start."""
    ramps = tuple(d for d in loop.disturbance if d.name == "ramp")
    setpoint = loop.setpoint.model_copy(
        update={"steps": tuple(step for step in loop.setpoint.steps if step[0] == 0.0)}
    )
    return loop.model_copy(
        update={"noise": Noise(), "disturbance": ramps, "setpoint": setpoint, "effect": ()}
    )
