"""What may be added to the loops of a grid so that they look more like recorded ones: effects,
loads and noise whose sizes are drawn in units of the loop's own motion (`nuisances.toml`), and what
a record of the folder lends, its archive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.lattice import read_lattice
from simbench.scenarios.grid_file import draw
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import read_toml

STRENGTHS = (0.3, 1.0, 3.0)  # factors on the sizes
_SMALLEST = 1e-12


@dataclass(frozen=True)
class Source:
    """What a nuisance is drawn from: random numbers, and a record of the folder."""

    rng: np.random.Generator
    record: LoopRecord


@dataclass(frozen=True)
class Nuisance:
    """One thing that grids may lack."""

    block: str  # of the loop
    # (loop, its record as it is, what is drawn from, strength) -> the loop with the nuisance
    add: Callable[[Loop, LoopRecord, Source, float], Loop]
    sized: bool = True  # whether it has a strength


def _read_nuisance(table: Mapping[str, Any]) -> Nuisance:
    """Return what a section of `nuisances.toml` states."""
    section = "effect" if "effect" in table else "disturbance"

    def add(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
        # what sizes are measured in: std of PV and OP, period (s) and frequency of OP
        period = _samples_per_period(record) * record.Ts
        pv = float(np.std(record.pv)) + _SMALLEST
        op = float(np.std(record.op)) + _SMALLEST
        units = {
            "": 1.0,
            "pv": pv,
            "op": op,
            "period": period,
            "per period": 1.0 / period,
            "op/sqrt(period)": op / period**0.5,
            "pv/sqrt(period)": pv / period**0.5,
            "period/op": period / op,
        }

        # Each number drawn, in the record's units, at the strength that was asked
        numbers: dict[str, Any] = {}
        for key, value in table["parameters"].items():
            numbers[key] = value
            if not isinstance(value, str):
                lo, hi, unit = value
                by = strength if key == table.get("sized") else 1.0
                numbers[key] = float(draw((lo, hi), source.rng)) * units[unit] * by
        part = Part(name=table[section], parameters=numbers)
        return loop.model_copy(update={section: (*getattr(loop, section), part)})

    return Nuisance(table["block"], add, "sized" in table)


def _lend_archive(loop: Loop, record: LoopRecord, source: Source, strength: float) -> Loop:
    """Return a loop written as a record of the folder: in its steps, against the size of its
    signals, and repeating samples where it does.
    """
    lent = source.record
    table = {}
    for name, other in (("op", "pv"), ("pv", "op")):
        real = np.asarray(getattr(lent, name), float)
        own = np.asarray(getattr(record, name), float)
        step = read_lattice(real, np.asarray(getattr(lent, other), float)).digits
        table[f"{name}_step"] = float(step * np.std(own) / (np.std(real) + _SMALLEST))
        held = np.diff(real) == 0.0
        if held.any():
            table[f"{name}_held"] = [0] + np.resize(held, loop.sampling.n - 1).astype(int).tolist()
    return loop.replace(archive=table)


def _samples_per_period(record: LoopRecord) -> float:
    """Return the samples of a period at the frequency below which half of OP's power lies."""
    op = np.asarray(record.op, float)
    power = np.abs(np.fft.rfft((op - op.mean()) * np.hanning(op.size))[1:]) ** 2
    total = np.cumsum(power)
    return op.size / (1.0 + float(np.searchsorted(total, 0.5 * total[-1])))


ADDITIONS: dict[str, Nuisance] = {
    **{
        name: _read_nuisance(table)
        for name, table in read_toml(Path(__file__).with_suffix(".toml")).items()
    },
    "the records' archives": Nuisance("lattice", _lend_archive, sized=False),
}
