"""What may be added to the loops of a grid so that they look more like recorded ones: effects,
loads and noise whose sizes are drawn in units of the loop's own motion, and what a record of the
folder lends: its archive, set point, length and samples per period.

Effects and loads stand in `nuisances.toml`, with the ranges of their sizes. Each is tried in three
strengths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.lattice import read_lattice
from simbench.gap.benchmark.features import samples_per_period
from simbench.scenarios.grid_file import draw
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import read_toml

STRENGTHS = (0.3, 1.0, 3.0)  # factors on the sizes
# samples of a loop whose length or sampling is a record's
_SHORTEST = 100
_LONGEST = 8000
_SMALLEST = 1e-12


class SizeRange(NamedTuple):
    """A parameter drawn evenly in logarithm, in a unit of `units_of`; one that is `sized` is
    multiplied by the strength.
    """

    lo: float
    hi: float
    unit: str = ""
    sized: bool = False


Parameters = Mapping[str, SizeRange | str]
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
    units = units_of(record)
    out = {}
    for name, one in wanted.items():
        if isinstance(one, str):
            out[name] = one
            continue
        size = float(draw((one.lo, one.hi), source.rng)) * units[one.unit]
        out[name] = size * strength if one.sized else size
    return out


def _with_part(loop: Loop, section: str, name: str, parameters: dict[str, Any]) -> Loop:
    """Return a loop with one effect or disturbance more."""
    part = Part(name=name, parameters=parameters)
    return loop.model_copy(update={section: (*getattr(loop, section), part)})


def _add_detuning(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop with another tuning, up or down by up to a factor."""
    most = np.log(1.0 + strength)
    Kc, Ti = np.exp(source.rng.uniform(-most, most, 2))
    factors = {"Kc_factor": float(Kc), "Ti_factor": float(Ti)}
    return _with_part(loop, "effect", "detuning", factors)


def _add_limits(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop whose OP ends within what it does now."""
    share = min(0.1 * strength, 0.4)
    lo, hi = (float(x) for x in np.quantile(record.op, (share, 1.0 - share)))
    return _with_part(loop, "effect", "saturation", {"lo": lo, "hi": hi})


def _lend_archive(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop written as a record of the folder: in its steps, against the size of its
    signals, and repeating samples where it does.
    """
    lent = source.record
    table = {}
    for name, other in (("op", "pv"), ("pv", "op")):
        real, own = (np.asarray(getattr(r, name), float) for r in (lent, record))
        step = read_lattice(real, np.asarray(getattr(lent, other), float)).digits
        table[f"{name}_step"] = float(step * np.std(own) / (np.std(real) + _SMALLEST))
        held = np.diff(real) == 0.0
        if held.any():
            table[f"{name}_held"] = [0, *np.resize(held, loop.sampling.n - 1).astype(int).tolist()]
    return loop.replace(archive=table)


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


def _of_table(table: Mapping[str, Any]) -> Nuisance:
    """Return what a section of `nuisances.toml` states."""
    section = "effect" if "effect" in table else "disturbance"
    wanted: dict[str, SizeRange | str] = {}
    for key, value in table["parameters"].items():
        of_size = key == table.get("sized")
        wanted[key] = value if isinstance(value, str) else SizeRange(*value, of_size)

    def add(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
        numbers = _parameters(wanted, record, source, strength)
        return _with_part(loop, section, table[section], numbers)

    return Nuisance(table["block"], add, "sized" in table)


ADDITIONS: dict[str, Nuisance] = {
    **{
        name: _of_table(table)
        for name, table in read_toml(Path(__file__).with_suffix(".toml")).items()
    },
    "the records' archives": Nuisance("lattice", _lend_archive, sized=False),
    "the records' set points": Nuisance("set point", _lend_setpoint, sized=False),
    "the records' lengths": Nuisance("length", _lend_length, sized=False),
    "the records' samples per period": Nuisance("samples per period", _lend_sampling, sized=False),
    "another tuning": Nuisance("controller", _add_detuning),
    "limits of OP": Nuisance("controller", _add_limits),
}
