"""Loops that copy a record: the plant of first order that was fitted, or one of the order that its
samples show, under a load that is drawn again from what both leave.

The load of a real plant is no Gaussian process: it rests, jumps and comes in bursts. Pieces of what
a record left keep that, and noise of the same spectrum does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from simbench.detectors.signal.filters import lfilter
from simbench.gap.closed_loop.arx import (
    Arx,
    in_samples,
    regress_law,
    regress_noise,
    regress_plant,
)
from simbench.gap.closed_loop.as_archived import digits_of
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import WITHIN, kick_of, moved
from simbench.gap.situation import Situation, through_valve
from simbench.scenarios.errors import SpecError
from simbench.scenarios.spec import Loop, Plant

# samples of a piece: a third of the period of the swing, so that no cycle hides in one, within
# these; and as many as a load needs that moves seldom
_SHORT, _LONG = (3, 20), 100
_SPARED = 3  # pieces at least that the residuals must hold
_MIDDLE = 50.0  # of OP's travel, where an OP of unknown unit is simulated
_AT_LIMIT = 0.02  # share of OP's samples at its largest or smallest value, from which it is a limit


class Copy(NamedTuple):
    """A loop that copies a record, and in words what it is made of."""

    loop: Loop
    plant: str  # "first order" or "as the samples show"
    load: str  # "Gaussian", or how long the pieces are (s)


def copies(s: Situation, fitted: Loop, effects: Sequence[Mapping[str, Any]]) -> Iterator[Copy]:
    """Yield the loops that may copy a record, the plainest first: the fitted one, and those whose
    load is drawn again; `effects` are those of the valve in all of them.
    """
    given, s, end = s, _in_travel(s), held_out(s)
    if s is given:
        yield Copy(fitted, "first order", "Gaussian")
    op, pv, sp = s.op[:end], s.record.pv[:end], s.sp[:end]
    law = regress_law(op, sp - pv)
    if law is None:
        return
    position, kick = op, max((kick_of(effect) for effect in effects), default=0.0)
    for effect in effects:
        position = through_valve(position, s.baseline, s.record.Ts, effect)
    tables = [("first order", _first_order(fitted.plant, position, pv, s))]
    shown = regress_plant(position, pv)
    if shown is not None:
        tables.append(("as the samples show", _as_shown(shown, s)))
    for name, (plant, op0, left, law_of_left) in tables:
        residuals = {
            "op": (law.left + law.constant).tolist(),
            "output": left.tolist(),
        }
        for piece in _pieces(op, left.size):
            load = {"type": "resampled", "piece": piece * s.record.Ts, **residuals}
            load |= {} if law_of_left is None else {"filter": law_of_left}
            table = {
                **_around(s, fitted, effects),
                "plant": plant,
                "controller": controller_of(law, s.record.Ts),
                "operating_point": {"op0": op0, "pv0": float(s.sp[0])},
                "disturbance": [load],
            }
            try:
                loop = moved(Loop.from_table(table, "copy"), kick)
                yield Copy(loop, name, f"{piece * s.record.Ts:.3g}")
            except SpecError:
                continue  # a pole at the edge of stability


def with_shown_law(s: Situation, loop: Loop) -> Loop | None:
    """Return a loop with the controller that the record shows in place of its own, what that leaves
    of OP drawn again; None where none is stable.
    """
    end = held_out(s)
    op = s.op[:end]
    law = regress_law(op, s.sp[:end] - s.record.pv[:end])
    if law is None:
        return None
    left = (law.left + law.constant).tolist()
    piece = _pieces(op, law.left.size)[0] * s.record.Ts
    table = loop.to_table() | {"controller": controller_of(law, s.record.Ts)}
    table["disturbance"] = [
        {"type": "resampled", "piece": piece, "op": left},
        *table["disturbance"],
    ]
    return Loop.from_table(table, "loop")


def _in_travel(s: Situation) -> Situation:
    """Return a situation whose OP lies in 0 to 100: where its unit is not known, about 50."""
    if s.op.min() >= 0.0 and s.op.max() <= 100.0:
        return s
    return replace(s, op=s.op + (_MIDDLE - float(s.op.mean())))


def archived(loop: Loop, s: Situation, held: bool) -> Loop:
    """Return a loop that states how its record is written: in the steps of the recorded samples,
    and (`held`) repeated where these repeat their last value.
    """
    op_step, pv_step = map(float, digits_of(s))
    table: dict[str, Any] = {"op_step": op_step, "pv_step": pv_step}
    if held:
        table |= {
            name: np.append(0, (np.diff(x) == 0.0).astype(int)).tolist()
            for name, x in (("op_held", s.op), ("pv_held", s.record.pv))
            if np.any(np.diff(x) == 0.0)
        }
    return Loop.from_table(loop.to_table() | {"archive": table}, "copy")


def _around(s: Situation, fitted: Loop, effects: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what stands around plant, controller and load: set point, sampling, valve, limits."""
    table = {name: fitted.to_table()[name] for name in ("sampling", "setpoint", "valve")}
    op = s.op
    limits = {
        name: end
        for name, end in (("lo", float(op.min())), ("hi", float(op.max())))
        if np.mean(op == end) > _AT_LIMIT
    }
    listed = [*effects, *([{"name": "saturation", **limits}] if limits else [])]
    return table | {"effect": listed}


def controller_of(law: Arx, Ts: float) -> dict[str, Any]:
    """Return the table of a controller whose changes of OP follow a regression."""
    den = np.convolve(law.den, [1.0, -1.0])
    num = law.driven
    size = max(den.size, num.size)
    den, num = (np.append(x, np.zeros(size - x.size)) for x in (den, num))
    return {"type": "tf", "num": num.tolist(), "den": den.tolist(), "dt": Ts}


def _as_shown(shown: Arx, s: Situation) -> tuple[dict[str, Any], float, np.ndarray, list[float]]:
    """Return the table of a plant that was regressed, OP at which it rests on the first set point,
    its residuals with what is left of that, and the filter they pass.
    """
    den, num = shown.den, shown.driven
    size = max(den.size, num.size + 1)
    table = {
        "type": "tf",
        "num": np.append(num, np.zeros(size - 1 - num.size)).tolist(),
        "den": np.append(den, np.zeros(size - den.size)).tolist(),
        "dt": s.record.Ts,
    }
    rest, gain = float(den.sum()) * float(s.sp[0]), float(num.sum())
    op0 = _within((rest - shown.constant) / gain if gain else np.nan, s)
    return table, op0, shown.left + shown.constant - (rest - gain * op0), den.tolist()


def _first_order(
    plant: Plant, position: np.ndarray, pv: np.ndarray, s: Situation
) -> tuple[dict[str, Any], float, np.ndarray, list[float] | None]:
    """Return as `_as_shown` does what a plant of first order leaves: noise on PV that follows from
    its own past.
    """
    num, den = in_samples(plant, s.record.Ts)
    about = float(np.mean(position))
    if plant.integrating:
        moved = np.asarray(lfilter(num, [1.0], position - about)) + float(num.sum()) * about
        noise = regress_noise(np.diff(pv, prepend=pv[0]) - moved)
        op0 = _within(-noise.constant / noise.den.sum() / float(num.sum()), s)
        left = noise.left + noise.constant + noise.den.sum() * float(num.sum()) * op0
        law = np.convolve(noise.den, den)
    else:
        noise = regress_noise(pv - np.asarray(lfilter(num, den, position - about)))
        level = noise.constant / float(noise.den.sum())  # PV at the mean position
        op0 = _within(about + (float(s.sp[0]) - level) / plant.K, s)
        off = level + plant.K * (op0 - about) - float(s.sp[0])
        left = noise.left + off * float(noise.den.sum())
        law = noise.den
    table = plant.model_dump(exclude_none=True)
    return table, op0, left, law.tolist() if law.size > 1 else None


def _within(op0: float, s: Situation) -> float:
    """Return OP at rest; its mean on record where that lies outside of its travel."""
    return float(op0) if WITHIN[0] <= op0 <= WITHIN[1] else float(np.clip(s.op.mean(), *WITHIN))


def _pieces(op: np.ndarray, samples: int) -> list[int]:
    """Return the lengths of pieces (samples) that are tried."""
    # the mean spectrum of overlapping halves (Welch 1967)
    half = op.size // 2
    parts = np.array([op[k : k + half] for k in (0, (op.size - half) // 2, op.size - half)])
    parts = (parts - parts.mean(axis=1, keepdims=True)) * np.hanning(half)
    power = (np.abs(np.fft.rfft(parts)) ** 2).mean(axis=0)
    third = int(np.clip(half / (1 + np.argmax(power[1:])) / 3.0, *_SHORT))
    return sorted({min(piece, max(samples // _SPARED, 1)) for piece in (third, _LONG)})
