"""Scale the effects diagnosed in a plant's loops, so that they can be added to loops of another
size and speed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.loop.effects import EFFECTS, Choice
from simbench.scenarios.spec import Loop

# what compares with a baseline, not with a grid
NOT_LACKING = ("gain_mismatch", "time_constant_mismatch", "dead_time_mismatch", "detuning", "noise")
FRICTION_EFFECT = (
    "stiction",
    "deadband",
)  # what takes the place of the friction that a loop of the grid has
# times that an effect may change a loop's size before its strength is measured by it no more
_GROWN = 2.0
_REST = 40.0  # samples that stand for the period of a record without one


@dataclass(frozen=True)
class Size:
    """By what a loop's effects are measured: spread of PV, range of OP (%), period (s)."""

    pv: float
    op: float
    period: float

    @classmethod
    def of(cls, record: LoopRecord) -> Size:
        """Return the size of a record."""
        op = record.op if record.op_percent is None else record.op_percent
        swing = find_oscillation(record.op, record.pv, record.Ts)
        period = swing.period_s if np.isfinite(swing.period_s) else _REST * record.Ts
        span = float(np.quantile(op, 0.99) - np.quantile(op, 0.01))
        return cls(float(np.std(record.pv)) or 1.0, span or 1.0, float(period))

    def towards(self, other: Size) -> Size:
        """Return the size of a loop that an effect has changed, by `_GROWN` at most: it may make it
        run away.
        """
        pv, op = (
            float(np.clip(b, a / _GROWN, a * _GROWN))
            for a, b in ((self.pv, other.pv), (self.op, other.op))
        )
        return Size(pv, op, self.period)

    def factor(self, unit: str) -> float:
        """Return what one of a parameter's unit is on this loop."""
        of = {
            "PV units": self.pv,
            "%": self.op,
            "% of travel": self.op,
            "s": self.period,
            "sqrt(s)": self.period**0.5,
        }
        above, _, below = unit.partition("/")
        return of.get(above, 1.0) / of.get(below, 1.0)


def relative(effect: str, parameters: Mapping[str, Any], size: Size) -> dict[str, Any]:
    """Return an effect's parameters relative to the size of their loop; words stay as they are."""
    return {
        k: v if isinstance(v, str) else v / size.factor(_unit(effect, k))
        for k, v in parameters.items()
    }


def absolute(effect: str, parameters: Mapping[str, Any], size: Size) -> dict[str, Any]:
    """Return relative parameters on another loop, within the effect's bounds."""
    out: dict[str, Any] = {}
    for name, value in parameters.items():
        if isinstance(value, str):
            out[name] = value
            continue
        rule = EFFECTS[effect].parameters[name]
        low, high = getattr(rule, "low", None), getattr(rule, "high", None)
        x = value * size.factor(_unit(effect, name))
        out[name] = float(
            np.clip(x, -np.inf if low is None else low, np.inf if high is None else high)
        )
    return out


def with_effect(loop: Loop, effect: str, parameters: Mapping[str, Any]) -> Loop:
    """Return a loop with one more effect; an effect of that name which it has already is
    replaced.
    """
    table = loop.to_table()
    rest = [e for e in table.get("effect", []) if e["name"] != effect]
    table["effect"] = [*rest, {"name": effect, **parameters}]
    return Loop.from_table(table, "scenario")


def scales(effect: str, names: Iterable[str]) -> dict[str, str] | None:
    """Return what a grid multiplies an effect's parameters by; None where a grid has no such
    scale.
    """
    words = {
        "PV units": "pv",
        "%": "S",
        "% of travel": "S",
        "s": "period",
        "": None,
        "-": None,
        "1/sample": None,
    }
    units = {
        n: _unit(effect, n) for n in names if not isinstance(EFFECTS[effect].parameters[n], Choice)
    }
    if any(u not in words for u in units.values()):
        return None
    return {n: str(words[u]) for n, u in units.items() if words[u]}


def _unit(effect: str, parameter: str) -> str:
    return getattr(EFFECTS[effect].parameters[parameter], "unit", "") or ""
