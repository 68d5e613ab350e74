"""Refuse comparisons that make no sense: signals in other units, or the baseline of another loop;
each refusal states its reason.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import still
from simbench.gap.controller.law import Law

_FEWEST = 100  # samples; below this the spread of every statistic swallows the gap
_LONGEST_RECORD = 50_000  # samples; beyond this the search takes hours
_NEAR_SHUT = 15.0  # % of mean OP, below which a valve of any characteristic is nearly a factor
_LEVEL = 0.15  # agreement of MV's slope and level, relative, from which both are one factor
_RATIOS = np.geomspace(0.01, 100.0, 400)  # of a characteristic's gains, none of them 1
_SCALES = {0.16: (3.8, 20.5, "mA"), 0.01: (0.0, 1.0, "a share of 1")}  # of OP, in addition to %

SAME_TS = 0.01  # relative difference of two sampling periods that a time column may leave
_FASTEST = 10  # runs of a controller in a sample of the archive, at most


def refuse_other_pace(period: float, stated: float, where: str) -> None:
    """Refuse a record whose sampling period (s) is not the baseline's, nor a few times as long."""
    times = period / stated
    if not 1 <= round(times) <= _FASTEST or abs(times / round(times) - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {period:g} s by its time column, but the baseline says Ts ="
            f" {stated:g} s; they must agree within 1 %, or the record's be up to {_FASTEST} times"
            " as long, where the controller runs faster than the archive"
        )


def refuse_mv_units(mv: np.ndarray, op: np.ndarray, where: str) -> None:
    """Refuse MV that is OP on another scale.

    A valve of any characteristic runs through (0, 0) and (100, 100): where its level is low its
    slope is not, and no valve moves against OP. One factor in both is a unit, but near (0, 0),
    where every valve is a factor.
    """
    low = float(mv.min())
    high = float(mv.max())
    span = f"MV runs from {low:g} to {high:g}"
    slope = moving_slope(op, mv)
    level = float(mv.mean() / op.mean()) if op.mean() > 0.0 else 1.0
    ahead = float(np.corrcoef(op, mv)[0, 1]) if np.ptp(mv) > 0.0 and np.ptp(op) > 0.0 else 0.0
    wrong = ""
    if low < -5.0 or high > 105.0:
        wrong = span
    elif high <= 1.5 and op.mean() > 5.0:
        wrong = f"{span}, a share of 1"
    elif (
        low >= 3.8
        and high <= 20.2
        and abs(np.mean(mv - (4.0 + 0.16 * op))) < 0.5 < abs(np.mean(mv - op))
    ):
        wrong = f"{span}, which is OP in mA"
    elif ahead < -0.9 or (ahead < -0.5 and slope is None and moving_slope(op, -mv) is not None):
        wrong = f"MV falls where OP rises (correlation {ahead:.2f})"
    elif (
        slope is not None
        and op.mean() > _NEAR_SHUT
        and not 0.7 < level < 1.4
        and _is_factor(slope, level, float(op.mean()))
    ):
        wrong = f"{span} and is {level:.3g} times OP in level and in slope"
    elif ahead > 0.999:
        # a straight line far from MV = OP, which no characteristic comes near to
        gain, offset = np.polyfit(op, mv, 1)
        left = float(np.std(mv - gain * op - offset))
        best = min(
            float(np.sqrt(np.mean((mv - 100.0 * np.expm1(r * op / 100.0) / np.expm1(r)) ** 2)))
            for r in np.log(_RATIOS)
        )
        if not 0.8 < gain < 1.25 and best > max(10.0 * left, 1.0):
            wrong = f"{span} and is {gain:.3g} OP {offset:+.3g} (correlation {ahead:.4f})"
    if wrong:
        raise RecordError(f"{where}: {wrong}; it must be in % of travel, 0..100, as OP is")


def _is_factor(slope: float, level: float, op: float) -> bool:
    """Return whether MV's slope agrees with its level, and better than with the characteristic that
    has this level at OP.
    """
    x = op / 100.0
    r = np.log(_RATIOS)
    bent = (r * np.exp(r * x) / np.expm1(r))[
        int(np.argmin(np.abs(np.expm1(r * x) / np.expm1(r) - level * x)))
    ]
    return bool(abs(slope / level - 1.0) < _LEVEL and abs(slope - level) < abs(slope - bent))


def moving_slope(op: np.ndarray, mv: np.ndarray) -> float | None:
    """Return how far MV moves per % of OP while it moves, friction or not; None where it seldom
    does.
    """
    du = np.diff(op)
    dv = np.diff(mv)
    least = 0.3 * float(np.std(du))
    # a slip is one step; between two steps of one direction the valve slides with OP
    slides = (
        (dv[1:-1] * du[1:-1] > 0)
        & (dv[:-2] * dv[1:-1] > 0)
        & (dv[2:] * dv[1:-1] > 0)
        & (np.abs(du[1:-1]) > least)
    )
    if slides.sum() < 20:
        return None
    return float(np.median(dv[1:-1][slides] / du[1:-1][slides]))


def refuse_op_units(op: np.ndarray, law: Law, Kc: float, Ti: float | None, where: str) -> None:
    """Refuse OP on another scale: the law is the baseline's but for the scale's factor, and OP lies
    within the scale.
    """
    if not law.known or (Ti and abs(law.Ti / Ti - 1.0) > 0.05):
        return
    for factor, (low, high, unit) in _SCALES.items():
        if low <= op.min() and op.max() <= high and abs(law.Kc / Kc / factor - 1.0) < 0.03:
            raise RecordError(
                f"{where}: OP runs from {op.min():g} to {op.max():g} and answers PV with {factor:g}"
                f" times the baseline's Kc: it is in {unit}; give --op-span, the values that mean 0"
                " and 100 %"
            )


def refuse_unfit(record: LoopRecord, where: str) -> None:
    """Refuse a record that is too short, too long, or in which nothing moved."""
    if record.n < _FEWEST:
        raise RecordError(f"{where}: {record.n} samples; a gap needs at least {_FEWEST} to show")
    if record.n > _LONGEST_RECORD:
        raise RecordError(
            f"{where}: {record.n} samples; a gap is sought in at most {_LONGEST_RECORD}, cut some"
            " out with --window FROM TO"
        )
    for name, x in (("OP", record.op), ("PV", record.pv)):
        if still(x):
            raise RecordError(
                f"{where}: {name} is constant ({x[0]:g}); nothing moved, so nothing can be told"
            )
