"""Turn a fit into a loop file: the baseline with the effect, the identified load and the set point
of the record.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.gap.closed_loop.level import WITHIN
from simbench.gap.effects import load_steps
from simbench.gap.effects._recogniser import clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import SHORTEST_LAG, Fit, input_gain, lag_of, load_std, valve_of
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS
from simbench.loop.plant import first_order_like, stretched
from simbench.scenarios.parts import OperatingPoint, Part, Sampling, SetPoint
from simbench.scenarios.plant import Plant
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import sampled_loop, ultimate_gain

# correlation of the noise from sample to sample, below which it is as good as white
_COLOURED = 0.15
_NIL = 1e-6  # of PV's standard deviation, up to which a fitted load is none
_LEAST = 1.01  # of the smallest noise that a fit believes, below which it found none


def fixed_loop(
    situation: Situation,
    fit: Fit,
    effects: dict[str, dict[str, float | str]],
    *,
    plant: str = "fitted",
    load: Fit | None = None,
    jumps: bool = True,
) -> Loop:
    """Return a loop file that simulates like the record."""
    # The baseline with the fitted plant, the recorded set point and the record's length
    base = situation.baseline
    identified = base.replace(
        plant=_fitted_plant(situation, fit) if plant == "fitted" else base.plant,
        setpoint=_recorded_set_point(situation),
        # in the samples of the loop: those of a record whose clock is a little off are others
        sampling=Sampling(Ts=base.sampling.Ts, n=situation.record.n * situation.pace),
    )

    # The fitted load, unless the loop file states one and is trusted
    as_stated = situation.trusted and plant == "baseline"
    if not (as_stated and base.disturbance):
        identified = _with_fitted_load(
            identified, situation, fit, load or fit, effects, as_stated=as_stated
        )
    identified = identified.replace(
        operating_point=_resting_point(situation, fit, effects, identified.plant),
        effect=(*base.effect, *(Part(name=name, parameters=p) for name, p in effects.items())),
    )

    # Jumps of the load are an effect of their own
    source = load or fit
    if jumps and source.spec.jumps and not source.spec.fade:
        steps = Part(name="load_steps", parameters=load_steps.numbers(source, situation))
        identified = identified.replace(effect=identified.effect + (steps,))

    # An identified loop must be stable to be simulated
    if situation.trusted:
        return identified
    return stable(identified)


def _fitted_plant(situation: Situation, fit: Fit) -> Plant:
    """Return the plant with the gain, the time constant and the dead time of a fit, but for those
    that an effect states in their place.
    """
    d = situation.data
    base = situation.baseline.plant
    Ts = situation.record.Ts
    per = Ts if situation.integrating else 1.0
    numbers = {
        "K": fit.K / per if fit.K * d.K > 0 else base.K,
        # an OP that was archived late hides as many samples of the dead time
        "Td": (fit.theta["Td"] + d.late + d.early) * Ts,
    }
    if d.T > 0:
        numbers["T"] = fit.theta["T"] * Ts
    numbers = {name: value for name, value in numbers.items() if name not in fit.spec.free}
    if d.shape is None:
        return base.replace(**numbers)
    like = first_order_like(base)
    if like.T and "T" in numbers:
        slower = numbers["T"] / like.T
    else:
        slower = 1.0
    return stretched(base, numbers.get("K", like.K) / like.K, slower, numbers.get("Td", base.Td))


def _recorded_set_point(situation: Situation) -> SetPoint:
    """Return the set point of the record, its steps in the samples of the loop."""
    sp = situation.sp
    period = situation.baseline.sampling.Ts * situation.pace
    moves = np.flatnonzero(np.diff(sp)) + 1
    steps = tuple((float(k * period), float(sp[k])) for k in moves)
    return SetPoint(value=float(sp[0]), steps=steps)


def _with_fitted_load(
    loop: Loop,
    situation: Situation,
    fit: Fit,
    source: Fit,
    effects: dict[str, dict[str, float | str]],
    *,
    as_stated: bool,
) -> Loop:
    """Return a loop under the load of `source` and the noise of `fit`; noise that remembers is a
    load on PV itself. `as_stated`: white noise is the baseline's.
    """
    loads = _fitted_loads(situation, source, effects)
    std = 0.0
    if fit.theta["noise_std"] >= _LEAST * situation.data.floor:
        if _is_correlated(source):
            loads.append(_coloured_noise(source, situation.record.Ts))
        else:
            if as_stated:
                std = situation.data.noise
            else:
                std = _fitted_noise(situation, fit)
    parts = tuple(Part.of("disturbance", load) for load in loads)
    return loop.replace(disturbance=parts, noise=loop.noise.replace(std=std))


def _resting_point(
    situation: Situation, fit: Fit, effects: dict[str, dict[str, float | str]], plant: Plant
) -> OperatingPoint:
    """Return where OP and PV rest before the run."""
    # a ramp begins at 0: OP's mean lies half of it away from where the record began
    half = 0.5 * situation.record.n * situation.record.Ts
    # on an integrating plant a ramp of the measurement is a load
    gain = plant.K if situation.data.T > 0 else np.inf
    led = shift_by_ramps(effects, half, gain)
    op0 = clip(_resting_op(situation, fit) + led, *WITHIN)
    return OperatingPoint(op0=op0, pv0=float(situation.sp[0]))


def shift_by_ramps(
    effects: Mapping[str, Mapping[str, float | str]], half: float, K: float
) -> float:
    """Return how far (%) OP's mean over a record lies from where it began under ramps: half the
    record in s, K of the plant. The controller moves OP against a ramp that it takes for PV.
    """
    per_unit = {"%/s": 1.0, "PV units/s": 1.0 / K}
    total = 0.0
    for e, p in effects.items():
        for name in p:
            unit = getattr(EFFECTS[e].parameters.get(name), "unit", "")
            if unit in per_unit:
                total += per_unit[unit] * half * float(p[name])
    return total


def _fitted_loads(
    situation: Situation, source: Fit, effects: dict[str, dict[str, float | str]]
) -> list[dict[str, Any]]:
    """Return the fitted load as the disturbances of a loop file.

    It was fitted as what it does to PV, through the gain of that fit; at the input it is the same
    in every arm.
    """
    # Each part of the load as a coloured disturbance
    Ts = situation.record.Ts
    d = situation.data
    K = abs(input_gain(source, d))
    loads = []
    for std, period, lag in load_parts(_with_kicks(source, d.n)):
        if std > _NIL * d.size:
            loads.append(
                {"type": "coloured", "amplitude": std / K, "period": period * Ts}
                | ({"lag": lag * Ts} if lag > 0.0 else {})
            )

    # Loads on PV that the fit follows
    wanders = source.spec.walk or "noise_std" in source.spec.free
    if wanders:
        loads += situation.loads_on_pv
    return loads


def _is_correlated(source: Fit) -> bool:
    """Return whether the fitted noise is correlated from sample to sample."""
    return source.theta["colour"] > _COLOURED and "noise_std" not in source.spec.free


def _coloured_noise(source: Fit, Ts: float) -> dict[str, Any]:
    """Return the fitted noise as a load on PV."""
    return {
        "type": "coloured",
        "amplitude": source.theta["noise_std"],
        "period": -Ts / float(np.log(source.theta["colour"])),
        "at": "output",
    }


def _fitted_noise(situation: Situation, fit: Fit) -> float:
    """Return the fitted noise without what rounding adds to it, which a simulation does again; the
    stated one where an effect says how much more there is.
    """
    if situation.trusted and "noise_std" in fit.spec.free:
        return situation.data.noise
    resolution = situation.data.resolution
    return float(np.sqrt(max(fit.theta["noise_std"] ** 2 - resolution**2 / 12.0, 0.0)))


def _with_kicks(source: Fit, n: int) -> Mapping[str, float]:
    """Return a fit's numbers with the variance of the kicks of its load, over n samples, in that of
    the load.
    """
    if not source.spec.fade:
        return source.theta
    kick = source.theta["load_jump"]
    period = source.theta["load_time"]
    kicks = kick * np.sqrt(0.5 * period * len(source.spec.jumps) / n)  # Campbell's theorem
    return {**source.theta, "load": float(np.hypot(source.theta["load"], kicks))}


def load_parts(theta: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return the parts of a fitted load: std of its steady effect on PV, correlation time, second
    time constant (samples).
    """
    std = load_std(theta)
    period = theta["load_time"]
    lag = lag_of(theta)
    if lag == kernels.PINK_LOAD:
        return [(std / np.sqrt(3.0), period / kernels.FRACTION**i, 0.0) for i in range(3)]
    return [(std, period, lag if lag > SHORTEST_LAG else 0.0)]


def _resting_op(situation: Situation, fit: Fit) -> float:
    """Return OP at which PV rests on the first set point, mean load included."""
    d = situation.data
    sp = situation.sp
    v = valve_of(fit.spec, fit.theta, d.u)
    gain = fit.K if fit.K != 0 else d.K
    if d.T > 0:
        ahead = (float(np.mean(d.y)) - sp[0]) / gain
    else:
        ahead = (d.y[-1] - d.y[0]) / (gain * d.n)

    # a valve with memory moves as far as OP on average; its regression on OP over a cycle tells the
    # lag between them
    maps = fit.spec.valve == kernels.CURVE or fit.spec.moves is not None
    if maps and np.ptp(v) > 0:
        slope = float(np.polyfit(v, situation.op, 1)[0])
    else:
        slope = 1.0
    return clip(float(np.mean(situation.op)) - ahead * slope, *WITHIN)


# --- Lower the gain of an identified plant where its loop would be unstable: the loop on record
# is not.


def stable(loop: Loop) -> Loop:
    """Return the loop with K at the margin of stability where it is beyond, its loads on PV kept.

    The loops of eight of 79 real records are identified beyond it, as a sticky valve or a load that
    swings tells little about the gain.
    """
    try:
        margin = ultimate_gain(sampled_loop(loop.model_copy(update={"effect": ()})))
    except ParameterError:
        # of a valve or controller without a linear model nobody knows the margin
        return loop
    if margin is None or margin >= 1.0:
        return loop
    loads = tuple(_weaken_load(load, margin) for load in loop.disturbance)
    return loop.replace(plant=loop.plant.with_gain(margin), disturbance=loads)


def _weaken_load(load: Part, margin: float) -> Part:
    """Return a load that moves PV as much behind a gain of `margin` times what it was."""
    p = load.parameters
    size = p.get("amplitude")
    if p.get("at", "input") != "input" or not isinstance(size, (int, float)):
        return load
    return Part(name=load.name, parameters={**p, "amplitude": size / margin})
