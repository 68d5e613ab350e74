"""Turn a fit into a loop file: the baseline with the effect, the identified load and the set point
of the record.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from simbench.gap.closed_loop.level import WITHIN
from simbench.gap.closed_loop.stable import stable
from simbench.gap.effects import load_steps
from simbench.gap.effects._recogniser import clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import (
    SHORTEST_LAG,
    Fit,
    input_gain,
    lag_of,
    load_std,
    valve_of,
)
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS
from simbench.loop.plant import first_order_like, stretched
from simbench.scenarios.spec import Loop, Plant

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
    record = situation.record
    d = situation.data
    base = situation.baseline
    Ts = record.Ts
    n = record.n
    table: dict[str, Any] = base.to_table()
    if plant == "fitted":
        per = Ts if situation.integrating else 1.0
        numbers = {
            "K": fit.K / per if fit.K * d.K > 0 else base.plant.K,
            # an OP that was archived late hides as many samples of the dead time
            "Td": (fit.theta["Td"] + d.late) * Ts,
        }
        numbers |= {"T": fit.theta["T"] * Ts} if d.T > 0 else {}
        for released in fit.spec.free:  # an effect states it in place of the fit
            numbers.pop(released, None)
        if d.shape is None:
            table["plant"] |= numbers
        else:
            like = first_order_like(base.plant)
            slower = numbers["T"] / like.T if like.T and "T" in numbers else 1.0
            table["plant"] = stretched(
                base.plant,
                numbers.get("K", like.K) / like.K,
                slower,
                numbers.get("Td", base.plant.Td),
            )
    # in the samples of the loop: those of a record whose clock is a little off are others
    sp = situation.sp
    period = base.sampling.Ts
    table["setpoint"] = {
        "value": float(sp[0]),
        "steps": [[float(k * period), float(sp[k])] for k in np.flatnonzero(np.diff(sp)) + 1],
    }
    table["sampling"] = {"Ts": period, "n": n}
    source = load or fit
    as_stated = situation.trusted and plant == "baseline"
    if not (as_stated and base.disturbance):
        noise = d.noise if as_stated else _noise(situation, fit)
        table["disturbance"] = _loads(situation, source, effects)
        if fit.theta["noise_std"] < _LEAST * d.floor:
            noise = 0.0
        elif _remembers(source):
            # noise that remembers is a load on PV itself
            table["disturbance"].append(_coloured_noise(source, Ts))
            noise = 0.0
        table["noise"] = table.get("noise", {}) | {"std": noise}
    # a ramp begins at 0: OP's mean lies half of it away from where the record began
    half = 0.5 * n * Ts
    # on an integrating plant a ramp of the measurement is a load
    gain = Plant.model_validate(table["plant"]).K if d.T > 0 else np.inf
    led = shift_by_ramps(effects, half, gain)
    table["operating_point"] = {
        "op0": clip(_rest(situation, fit) + led, *WITHIN),
        "pv0": float(sp[0]),
    }
    table["effect"] = [*table.get("effect", []), *({"name": e, **p} for e, p in effects.items())]
    if jumps and source.spec.jumps and not source.spec.fade:
        table["effect"].append({"name": "load_steps", **load_steps.numbers(source, situation)})
    loop = Loop.from_table(table, "fixed loop")
    return loop if situation.trusted else stable(loop)


def shift_by_ramps(
    effects: Mapping[str, Mapping[str, float | str]], half: float, K: float
) -> float:
    """Return how far (%) OP's mean over a record lies from where it began under ramps: half the
    record in s, K of the plant. The controller moves OP against a ramp that it takes for PV.
    """
    per_unit = {"%/s": 1.0, "PV units/s": 1.0 / K}
    return sum(
        per_unit[unit] * half * float(p[name])
        for e, p in effects.items()
        for name in p
        if (unit := getattr(EFFECTS[e].parameters.get(name), "unit", "")) in per_unit
    )


def _loads(
    situation: Situation, source: Fit, effects: dict[str, dict[str, float | str]]
) -> list[dict[str, Any]]:
    """Return the fitted load as the disturbances of a loop file.

    It was fitted as what it does to PV, through the gain of that fit; at the input it is the same
    in every arm.
    """
    Ts = situation.record.Ts
    d = situation.data
    K = abs(input_gain(source, d))
    loads = [
        {"type": "coloured", "amplitude": std / K, "period": period * Ts}
        | ({"lag": lag * Ts} if lag > 0.0 else {})
        for std, period, lag in load_parts(_with_kicks(source, d.n))
        if std > _NIL * d.size
    ]
    wanders = source.spec.walk or "noise_std" in source.spec.free
    if wanders:
        loads += situation.loads_on_pv
    return loads


def _remembers(source: Fit) -> bool:
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


def _noise(situation: Situation, fit: Fit) -> float:
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


def _rest(situation: Situation, fit: Fit) -> float:
    """Return OP at which PV rests on the first set point, mean load included."""
    d = situation.data
    sp = situation.sp
    v = valve_of(fit.spec, fit.theta, d.u)
    gain = fit.K if fit.K != 0 else d.K
    ahead = (float(np.mean(d.y)) - sp[0]) / gain if d.T > 0 else (d.y[-1] - d.y[0]) / (gain * d.n)
    # a valve with memory moves as far as OP on average; its regression on OP over a cycle tells the
    # lag between them
    maps = fit.spec.valve == kernels.CURVE or fit.spec.moves is not None
    slope = float(np.polyfit(v, situation.op, 1)[0]) if maps and np.ptp(v) > 0 else 1.0
    return clip(float(np.mean(situation.op)) - ahead * slope, *WITHIN)
