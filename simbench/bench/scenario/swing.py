"""Let a healthy loop oscillate as sticky ones do, so that neither amplitude nor period tells them
apart.

A load makes it oscillate, or its own tuning. Amplitude and period are those of a sticky valve's
cycle in the same loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from simbench.loop import plant
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulated_op
from simbench.scenarios.cell import CycleScale, WantedOscillation
from simbench.scenarios.spec import Loop, Noise, Part

_SHORTEST = 4.0  # samples per period of an oscillation
_DIGITS = 3  # ids must not hang on the last bits of a simulation
_FINE = 5  # digits of a gain at the limit of stability
# periods in which the load that lets an oscillation wander forgets itself, and its lag: a loop at
# its limit of stability would answer to one that is not smooth
_WANDERS, _WANDERS_SLOWLY = (1.0, 0.0), (4.0, 1.5)
_SLOW_SHARE = 0.6  # size of the second over the first: as it forgets later, it moves the mean more
# of a loop that oscillates by its tuning: how many gains are tried, and between which shares of the
# gain at which the loop alone neither grows nor fades; with noise it is a lower one
_TRIES, _NOISES, _SHARES = 9, 4, (0.8, 1.08)
_LARGEST_EXCITATION = 8.0  # OP stds of the wanted oscillation: a larger one may bring OP to a limit
# logarithm of the OP std in the first or last fifth of a record over that of the whole: the first
# is taken at once, above the second no tuning is taken; nine in ten sticky loops of grid chapter
# that no load drives have less than 0.08
_STEADY, _UNSTEADY = 0.015, 0.06
# logarithm of the variance of OP over the wanted one: more in a loop whose valve is far from linear
_UNLIKE = 0.5


class UnmatchedError(Exception):
    """A healthy loop that cannot oscillate as its sticky siblings do."""


@dataclass(frozen=True)
class Cycle:
    """How the sticky twin of a cell moves, or how a healthy loop should."""

    period: float  # of MV (s)
    pv_std: float  # of PV over the run but its first period (PV units)
    op_std: float  # of OP there (%)
    exists: bool  # False when no start set it going; then the other numbers are guesses


def significant(x: float, digits: int = _DIGITS) -> float:
    """Return a number rounded to a few digits, so that ids do not hang on a simulation's last
    bits.
    """
    return float(f"{x:.{digits}g}")


def absolute_load(load: Mapping[str, Any], size: float, period: float) -> dict[str, Any]:
    """Return the table of a load whose amplitude is given in units of `size` and whose times in
    units of `period`.
    """
    scale = {"amplitude": size, "period": period, "lag": period, "start": period}
    return {k: significant(v * scale[k]) if k in scale else v for k, v in load.items()}


def scaled_cycle(cycle: Cycle, scale: CycleScale) -> Cycle:
    """Return the cycle of the sticky twin in the units of a member: in a linear loop with friction
    it is the member's own.
    """
    return replace(
        cycle,
        period=cycle.period * scale.time,
        pv_std=cycle.pv_std * scale.S * scale.pv,
        op_std=cycle.op_std * scale.S,
    )


def add_load(table: dict[str, Any], swing: WantedOscillation, cycle: Cycle) -> None:
    """Add the load that gives a healthy loop the period and the OP std of a cycle, and a slow one
    that makes it wander.
    """
    assert swing.load is not None
    load = absolute_load(
        {**swing.load, "amplitude": 1.0, "period": 1.0}, cycle.pv_std, cycle.period
    )
    table["disturbance"] = [*table.get("disturbance", []), load]
    loop = Loop.from_table(table, "cell")
    for _ in range(2):  # the first is exact in a linear loop
        std = float(np.std(simulated_op(loop)))
        if std == 0.0:  # OP stands at a limit
            raise UnmatchedError
        load["amplitude"] = significant(load["amplitude"] * cycle.op_std / std)
        *others, last = loop.disturbance
        sized = (*others, _sized(last, load["amplitude"]))
        loop = loop.model_copy(update={"disturbance": sized})
    slow = _slow_load(swing.wander, cycle, *_WANDERS)
    table["disturbance"].append({"type": slow.name, **slow.parameters})


def at_its_limit(loop: Loop, cycle: Cycle) -> tuple[Loop, Cycle]:
    """Return a loop with the dead time at which it neither grows nor fades, and how it oscillates.

    Its tuning was right for a shorter dead time. With the controller as it is, PV and noise are as
    large beside OP as in a sticky loop, and the period is near that of its cycle.
    """
    Ts, setup, control = loop.sampling.Ts, plain_setup(loop, 0), loop.controller
    g = plant.sample(setup.num, setup.den, 0.0, Ts)

    def answers(w: float) -> tuple[complex, complex]:  # of the controller, and of both in series
        z = np.exp(1j * w * Ts)
        C = (
            control.sign
            * control.Kc
            * (1.0 if control.Ti is None else 1.0 + Ts / control.Ti * z / (z - 1.0))
        )
        return C, C * (g.B_old[0] / z + g.B_new[0]) / (z - g.A[0, 0]) * g.C[0] * z ** -float(
            g.delay
        )

    fastest = 2.0 * math.pi / (_SHORTEST * Ts)
    slowest = min(2.0 * math.pi / cycle.period, fastest) / 100.0
    if not abs(answers(slowest)[1]) > 1.0 > abs(answers(fastest)[1]):
        raise UnmatchedError
    w = float(brentq(lambda x: math.log(abs(answers(x)[1])), slowest, fastest))
    C, both = answers(w)
    late = (math.pi + math.atan2(both.imag, both.real)) / w
    own = replace(cycle, period=2.0 * math.pi / w, pv_std=cycle.op_std / abs(C))
    return loop.with_("plant.Td", significant(late)), own


def steadied(loop: Loop, swing: WantedOscillation, cycle: Cycle, seed: int) -> tuple[Loop, int]:
    """Return a loop at its limit of stability, and its seed, that swings evenly with a cycle's OP
    std.

    Its answers to excitation and noise add up. A bisection finds the gain at which their sum is as
    wide at the record's end as at its beginning; for each gain the size of the excitation follows
    from the wanted std. Where no gain does it, another noise is drawn.
    """
    drift = _slow_load(_SLOW_SHARE * swing.wander, cycle, *_WANDERS_SLOWLY)
    loads = loop.disturbance
    if any(t == 0.0 for t, _ in loop.setpoint.steps):  # one excitation: two may cancel each other
        loads = tuple(d for d in loads if d.name != "ramp")
    loop = loop.model_copy(update={"disturbance": (*loads, drift)})
    # an excitation that moves OP by about the wanted std, and to no limit
    loop = _excited(loop, cycle.op_std / max(_excitation(loop), 1e-9))
    Kc, found, least = loop.controller.Kc, (loop, seed), math.inf
    wanted = cycle.op_std**2 + (Kc * loop.noise.std) ** 2
    for own in (seed + k for k in range(_NOISES)):
        (lo, hi), share = _SHARES, 1.0
        for _ in range(_TRIES):
            control = loop.controller.model_copy(update={"Kc": significant(share * Kc, _FINE)})
            tuned = loop.model_copy(update={"controller": control})
            noisy = simulated_op(_excited(tuned, 0.0), own)
            excited = simulated_op(_without_loads(tuned), own)
            factor, grows = _size_of_excitation(noisy, excited - excited.mean(), wanted)
            if factor < _LARGEST_EXCITATION:
                candidate = _excited(tuned, significant(factor))
                op = simulated_op(candidate, own)
                begin, end = (
                    math.log(max(float(np.std(x)), 1e-9) / max(float(np.std(op)), 1e-9))
                    for x in (op[: op.size // 5], op[-op.size // 5 :])
                )
                grows, uneven = end > begin, max(abs(begin), abs(end))
                # the variance is another one where the valve is far from linear
                if (
                    uneven < least
                    and abs(math.log(max(float(np.var(op)), 1e-9) / wanted)) < _UNLIKE
                ):
                    found, least = (candidate, own), uneven
            if least < _STEADY:
                return found
            lo, hi = (lo, share) if grows else (share, hi)
            share = 0.5 * (lo + hi)
    if least > _UNSTEADY:
        raise UnmatchedError
    return found


def _size_of_excitation(
    noisy: np.ndarray, excited: np.ndarray, wanted: float
) -> tuple[float, bool]:
    """Return the factor on `excited` that gives its sum with `noisy` the wanted variance.

    Infinite where there is none; then also whether `noisy` alone has a larger one.
    """
    size, lacking = float(np.var(excited)), wanted - float(np.var(noisy))
    if lacking < 0.0 or size == 0.0:
        return math.inf, lacking < 0.0
    half = float(np.mean((noisy - noisy.mean()) * excited))
    return (math.sqrt(half**2 + lacking * size) - half) / size, False


def _slow_load(wander: float, cycle: Cycle, periods: float, lag: float) -> Part:
    """Return the load at the plant's input that lets an oscillation wander, in so many periods."""
    times = {"period": significant(periods * cycle.period), "lag": significant(lag * cycle.period)}
    size = significant(wander * cycle.op_std)
    return Part(name="coloured", parameters={"at": "input", "amplitude": size, **times})


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
    rest = loop.setpoint.value
    steps = tuple(
        (t, rest + (v - rest) * factor if t == 0.0 else v) for t, v in loop.setpoint.steps
    )
    setpoint = loop.setpoint.model_copy(update={"steps": steps})
    loads = tuple(
        _sized(d, float(d.parameters["amplitude"]) * factor)  # type: ignore[arg-type]
        if d.name == "ramp"
        else d
        for d in loop.disturbance
    )
    return loop.model_copy(update={"setpoint": setpoint, "disturbance": loads})


def _sized(load: Part, amplitude: float) -> Part:
    return Part(name=load.name, parameters={**load.parameters, "amplitude": amplitude})


def _without_loads(loop: Loop) -> Loop:
    """Return the loop with nothing but the excitation at its start."""
    ramps = tuple(d for d in loop.disturbance if d.name == "ramp")
    setpoint = loop.setpoint.model_copy(
        update={"steps": tuple(step for step in loop.setpoint.steps if step[0] == 0.0)}
    )
    return loop.model_copy(
        update={"noise": Noise(), "disturbance": ramps, "setpoint": setpoint, "effect": ()}
    )
