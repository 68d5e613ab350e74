"""What may be added to the loops of a grid so that they look more like recorded ones: effects,
loads and noise whose sizes are drawn in units of the loop's own motion, and what a record of the
folder lends: its archive, set point, length and samples per period.

The sizes are those of the grids `plant` and `families` (docs/plant_grid.md), where these have the
effect. Each is tried in three strengths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.lattice import read_lattice
from simbench.gap.benchmark.features import samples_per_period
from simbench.scenarios.spec import Loop, Part

STRENGTHS = (0.3, 1.0, 3.0)  # factors on the sizes
# samples of a loop whose length or sampling is a record's
_SHORTEST, _LONGEST = 100, 8000
_SMALLEST = 1e-12


class Drawn(NamedTuple):
    """A parameter drawn evenly in logarithm, in a unit of `units_of`; one that is `sized` is
    multiplied by the strength.
    """

    lo: float
    hi: float
    unit: str = ""
    sized: bool = False


Parameters = Mapping[str, Drawn | str]
# (loop, its record as it is, what is drawn from, strength) -> the loop with the nuisance
_Adding = Callable[[Loop, LoopRecord, "Source", float], Loop]


@dataclass(frozen=True)
class Source:
    """What a nuisance is drawn from: random numbers, and a record of the folder."""

    rng: np.random.Generator
    record: LoopRecord


@dataclass(frozen=True)
class Nuisance:
    """One thing that grids may lack."""

    block: str  # of `features.BLOCKS`
    add: _Adding
    sized: bool = True  # whether it has a strength


def units_of(record: LoopRecord) -> dict[str, float]:
    """Return what sizes are measured in: std of PV and OP, period (s) and frequency of OP."""
    period = samples_per_period(record) * record.Ts
    return {
        "": 1.0,
        "pv": float(np.std(record.pv)) + _SMALLEST,
        "op": float(np.std(record.op)) + _SMALLEST,
        "period": period,
        "per period": 1.0 / period,
        "op/sqrt(period)": float(np.std(record.op)) / period**0.5,
        "pv/sqrt(period)": float(np.std(record.pv)) / period**0.5,
        "period/op": period / (float(np.std(record.op)) + _SMALLEST),
    }


def _parameters(
    wanted: Parameters, record: LoopRecord, source: Source, strength: float
) -> dict[str, Any]:
    units, out = units_of(record), {}
    for name, one in wanted.items():
        if isinstance(one, str):
            out[name] = one
            continue
        size = float(np.exp(source.rng.uniform(np.log(one.lo), np.log(one.hi)))) * units[one.unit]
        out[name] = size * strength if one.sized else size
    return out


def _add_effect(
    name: str, wanted: Parameters, loop: Loop, record: LoopRecord, source: Source, strength: float
) -> Loop:
    part = Part(name=name, parameters=_parameters(wanted, record, source, strength))
    return loop.model_copy(update={"effect": (*loop.effect, part)})


def _add_load(
    name: str, wanted: Parameters, loop: Loop, record: LoopRecord, source: Source, strength: float
) -> Loop:
    part = Part(name=name, parameters=_parameters(wanted, record, source, strength))
    return loop.model_copy(update={"disturbance": (*loop.disturbance, part)})


def _add_detuning(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop with another tuning, up or down by up to a factor."""
    most = np.log(1.0 + strength)
    Kc, Ti = np.exp(source.rng.uniform(-most, most, 2))
    part = Part(name="detuning", parameters={"Kc_factor": float(Kc), "Ti_factor": float(Ti)})
    return loop.model_copy(update={"effect": (*loop.effect, part)})


def _add_limits(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop whose OP ends within what it does now."""
    share = min(0.1 * strength, 0.4)
    lo, hi = (float(x) for x in np.quantile(record.op, (share, 1.0 - share)))
    part = Part(name="saturation", parameters={"lo": lo, "hi": hi})
    return loop.model_copy(update={"effect": (*loop.effect, part)})


def _lend_archive(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop written as a record of the folder: in its steps, against the size of its
    signals, and repeating samples where it does.
    """
    lent, table = source.record, {}
    for name, other in (("op", "pv"), ("pv", "op")):
        real, own = (np.asarray(getattr(r, name), float) for r in (lent, record))
        step = read_lattice(real, np.asarray(getattr(lent, other), float)).digits
        table[f"{name}_step"] = float(step * np.std(own) / (np.std(real) + _SMALLEST))
        held = np.diff(real) == 0.0
        if held.any():
            table[f"{name}_held"] = [0, *np.resize(held, loop.sampling.n - 1).astype(int).tolist()]
    return Loop.from_table(loop.to_table() | {"archive": table})


def _lend_setpoint(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop whose set point moves as that of a record of the folder: at the same shares of
    its length, by the same sizes against PV's standard deviation.
    """
    lent = source.record
    if lent.sp is None:
        return loop
    sp = np.asarray(lent.sp, float)
    by = float(np.std(record.pv)) / (float(np.std(lent.pv)) + _SMALLEST)
    pace = loop.sampling.n / lent.n * loop.sampling.Ts
    ahead = (loop.sampling.warm_up or 0) * loop.sampling.Ts
    start = loop.setpoint.steps[-1][1] if loop.setpoint.steps else loop.setpoint.value
    moves = [
        (ahead + pace * float(k), start + by * float(sp[k] - sp[0]))
        for k in np.flatnonzero(np.diff(sp)) + 1
    ]
    kept = [s for s in loop.setpoint.steps if not moves or s[0] < moves[0][0]]
    setpoint = loop.setpoint.model_copy(update={"steps": (*kept, *moves)})
    return loop.model_copy(update={"setpoint": setpoint})


def _lend_length(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    n = int(np.clip(source.record.n, _SHORTEST, _LONGEST))
    return loop.with_("sampling.n", n)


def _lend_sampling(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop with as many samples per period as a record of the folder, as long as it was
    in periods.
    """
    by = samples_per_period(source.record) / samples_per_period(record)
    n = float(np.clip(by * loop.sampling.n, _SHORTEST, _LONGEST))
    by = n / loop.sampling.n
    changed = {"sampling.Ts": loop.sampling.Ts / by, "sampling.n": round(n)}
    if loop.sampling.warm_up:
        changed["sampling.warm_up"] = round(by * loop.sampling.warm_up)
    return loop.with_all(changed)


def _effect(block: str, name: str, **wanted: Drawn | str) -> Nuisance:
    return Nuisance(block, partial(_add_effect, name, wanted), _has_size(wanted))


def _load(block: str, name: str, **wanted: Drawn | str) -> Nuisance:
    return Nuisance(block, partial(_add_load, name, wanted), _has_size(wanted))


def _has_size(wanted: Parameters) -> bool:
    return any(isinstance(one, Drawn) and one.sized for one in wanted.values())


_SPELL = {"share": Drawn(0.05, 0.2, sized=True), "length": Drawn(0.05, 0.5, "period")}
NUISANCES: dict[str, Nuisance] = {
    "white noise": _effect("noise", "noise", std=Drawn(0.05, 0.3, "pv", sized=True)),
    "coloured noise": _load(
        "noise",
        "coloured",
        amplitude=Drawn(0.1, 0.6, "pv", sized=True),
        period=Drawn(0.01, 0.1, "period"),
        at="output",
    ),
    "outliers": _effect(
        "noise", "outliers", rate=Drawn(0.001, 0.01), size=Drawn(2.0, 6.0, "pv", sized=True)
    ),
    "sensor lag": _effect("noise", "sensor_lag", tau=Drawn(0.01, 0.05, "period", sized=True)),
    "quantisation": _effect("lattice", "quantisation", step=Drawn(0.1, 0.8, "pv", sized=True)),
    "quantisation in the archive": _effect(
        "lattice", "quantisation", step=Drawn(0.1, 0.8, "pv", sized=True), at="record"
    ),
    "OP quantisation": _effect(
        "lattice", "op_quantisation", step=Drawn(0.1, 0.8, "op", sized=True)
    ),
    "compression": _effect("lattice", "compression", band=Drawn(0.05, 0.4, "pv", sized=True)),
    "frozen sensor": _effect("lattice", "frozen_sensor", **_SPELL),
    "the records' archives": Nuisance("lattice", _lend_archive, sized=False),
    "coloured load on PV": _load(
        "load",
        "coloured",
        amplitude=Drawn(0.5, 2.0, "pv", sized=True),
        period=Drawn(0.1, 2.0, "period"),
        at="output",
    ),
    "coloured load": _load(
        "load",
        "coloured",
        amplitude=Drawn(0.5, 2.0, "op", sized=True),
        period=Drawn(0.1, 2.0, "period"),
        at="input",
    ),
    "load steps": _effect(
        "load",
        "load_steps",
        rate=Drawn(0.1, 0.7, "per period"),
        size=Drawn(0.5, 2.0, "op", sized=True),
    ),
    "load drift": _effect(
        "load", "load_drift", walk=Drawn(0.2, 1.0, "op/sqrt(period)", sized=True)
    ),
    "oscillation from outside": _effect(
        "load",
        "oscillation",
        amplitude=Drawn(0.7, 2.0, "op", sized=True),
        period=Drawn(0.4, 2.5, "period"),
    ),
    "sensor drift": _effect("load", "drift", walk=Drawn(0.1, 0.5, "pv/sqrt(period)", sized=True)),
    "the records' set points": Nuisance("set point", _lend_setpoint, sized=False),
    "the records' lengths": Nuisance("length", _lend_length, sized=False),
    "the records' samples per period": Nuisance("samples per period", _lend_sampling, sized=False),
    "extra lag": _effect(
        "samples per period", "extra_lag", tau=Drawn(0.02, 0.2, "period", sized=True)
    ),
    "longer dead time": _effect(
        "samples per period", "dead_time_mismatch", extra=Drawn(0.02, 0.2, "period", sized=True)
    ),
    "another gain": _effect("samples per period", "gain_mismatch", factor=Drawn(0.5, 2.0)),
    "another time constant": _effect(
        "samples per period", "time_constant_mismatch", factor=Drawn(0.5, 2.0)
    ),
    "derivative action": _effect(
        "controller",
        "derivative_action",
        Td=Drawn(0.02, 0.1, "period", sized=True),
        filter=Drawn(0.002, 0.01, "period"),
    ),
    "detuning": Nuisance("controller", _add_detuning),
    "error dead-band": _effect(
        "controller", "error_deadband", width=Drawn(0.2, 1.5, "pv", sized=True)
    ),
    "limits of OP": Nuisance("controller", _add_limits),
    "missed executions": _effect("controller", "missed_executions", **_SPELL),
    "valve lag": _effect("valve", "valve_lag", tau=Drawn(0.01, 0.05, "period", sized=True)),
    "slew limit": _effect(
        "valve", "slew_limit", slowness=Drawn(0.02, 0.2, "period/op", sized=True)
    ),
    "valve characteristic": _effect("valve", "valve_characteristic", R=Drawn(10.0, 50.0)),
    "dead-zone": _effect("valve", "deadzone", D=Drawn(0.3, 1.5, "op", sized=True)),
}
