"""Evaluate a travel test that was recorded in a plant: any staircase of OP in manual; read the
controller gain off a record.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simbench.confirm.rig import Trace
from simbench.confirm.travel import SIGMAS, Interval, TravelTest
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord

# of the variance of OP's increments by a PI controller, from which its gain is read off a record
_EXPLAINED = 0.8
_HELD = 5  # samples for which OP must rest between two steps
_LATE = 0.75  # of a hold, from which on PV counts as settled
_FEWEST = 4  # holds
# sizes of S and J that are tried, from a share of the smallest step to a little more than OP's
# range, and the shares of S by which OP had moved on since the valve last moved before the test
_SIZES = 120
_JUMPS = 40
_BEGUN = (0.0, 0.4, 0.8)
_SMALLEST = 0.3
_LARGEST = 1.1
_MOST_J = 1.2
_AT_ONCE = 2000  # valves whose readings are fitted together
_NUMBERS = 5  # S, J, level, gain and lost motion: what is fitted to the readings
_WORSE = 9.0  # variances of a reading, by which a valve may fit worse than the best (3 sigma)
_APART = 1e-9  # share of a band, by which rounding may pass it
# of a step's effect, by which PV still moves in the last quarter of a hold that has not settled
_UNSETTLED = 0.1
# % of travel, up to which friction is harmless (Table 11.1 after Ruel 2000: 1 %), and a step of the
# sizes that are tried
_HARMLESS = 1.05
_SURE = 0.02  # of the smallest step's effect, to which a reading is known at best


def controller_gain(record: LoopRecord) -> float | None:
    """Return the controller gain that a record shows, in OP units per PV unit; None when OP is not
    that of a PI controller.

    Least squares of OP's increments on the error's increments and the error.
    """
    steps = np.diff(record.op)
    error = record.e
    columns = np.column_stack([np.diff(error), error[1:]])
    gains = np.linalg.lstsq(columns, steps, rcond=None)[0]
    left = steps - columns @ gains
    explained = 1.0 - float(left @ left) / max(float(steps @ steps), 1e-300)
    if explained >= _EXPLAINED:
        return abs(float(gains[0]))
    return None


class _Readings(NamedTuple):
    """What a signal was at the end of every hold: OP (%), the signal, its standard error, and
    whether it still moved in holds after a step.
    """

    op: np.ndarray
    seen: np.ndarray
    error: float
    settled: bool


class _Bands(NamedTuple):
    """S and J (%) of the valves that explain the readings, from the least to the largest."""

    S: Interval
    J: Interval
    moved: np.ndarray  # (n,) last direction in which the likeliest one moved


def travel_recorded(record: LoopRecord) -> TravelTest:
    """Read S and J off the record of a valve travel test: any staircase of OP in manual, of steps
    of any size and order, up and down.

    A valve that has moved moves on once OP has gone on by more than J, and back once OP has turned
    by more than S from where the valve last moved; behind OP it stays by (S - J)/2 (Choudhury,
    Thornhill and Shah 2005). All S and J are kept that explain the settled readings as well as the
    best: S lies between the last sum of steps that moved nothing and the first that did, J is S
    less the lost motion between steps up and down. S is what ISA-51.1 calls dead band, the motion
    of OP after a reversal that moves nothing. MV is read where it was recorded and PV does not
    contradict it.
    """
    # Where OP rests long enough to read PV
    op = record.op if record.op_percent is None else record.op_percent
    starts = np.concatenate([[0], np.flatnonzero(np.diff(op)) + 1])
    lengths = np.diff(np.append(starts, op.size))
    starts = starts[lengths >= _HELD]
    lengths = lengths[lengths >= _HELD]

    # A staircase has several levels
    if starts.size < _FEWEST:
        raise ParameterError(
            f"travel test: OP rests {starts.size} times for {_HELD} samples or more; at least"
            f" {_FEWEST} are needed"
        )
    if np.ptp(op[starts]) == 0.0:
        raise ParameterError(
            f"travel test: OP rests at {op[starts][0]:g} % alone; two levels at least are needed"
        )

    # S and J by PV, or by MV where that agrees with it
    holds = op, starts, lengths
    by_pv = _read_holds(record.pv, record.Ts, *holds, slope=record.process == "integrating")
    if _moves_beyond_noise(by_pv):
        bands = _explaining_bands(by_pv)
    else:
        bands = None
    if record.mv is not None:
        by_mv = _read_holds(np.asarray(record.mv), record.Ts, *holds, slope=False)
        if bands is not None and _moves_beyond_noise(by_mv):
            told = _explaining_bands(by_mv)
            if _intervals_meet(told.S, bands.S):
                bands = told

    # Whether the valve sticks, in words
    increment = float(np.abs(np.diff(by_pv.op))[np.diff(by_pv.op) != 0.0].min())
    sticky, reason = _in_words(bands, increment, by_pv.settled)
    if bands is None:
        S = None
        J = None
    else:
        S = bands.S
        J = bands.J

    # The middle of each range is the estimate
    return TravelTest(
        None if J is None else _middle_of(J),
        None if S is None else _middle_of(S),
        increment,
        float(lengths.min()) * record.Ts,
        sticky,
        reason,
        record.Ts,
        _phase_of_samples(*holds, bands),
        Trace(op, record.pv, np.full(op.size, np.nan) if record.mv is None else record.mv),
        S,
        J,
    )


def _read_holds(
    x: np.ndarray,
    Ts: float,
    op: np.ndarray,
    starts: np.ndarray,
    lengths: np.ndarray,
    *,
    slope: bool,
) -> _Readings:
    """Return a signal's settled mean in every hold, or its slope per second."""
    # The mean, or the slope, of the late part of each hold, and its error
    seen, errors, moving = np.empty((3, starts.size))
    for k, (start, length) in enumerate(zip(starts, lengths, strict=True)):
        late = x[start + int(_LATE * length) : start + length]
        t = np.arange(late.size) * Ts
        if late.size > 2:
            line = np.polyfit(t, late, 1)
        else:
            line = np.array([0.0, late.mean()])
        sigma = float(np.std(late - np.polyval(line, t)))
        moving[k] = line[0] * (t[-1] + Ts)
        if slope:
            seen[k] = line[0]
        else:
            seen[k] = late.mean()
        errors[k] = sigma / np.sqrt(late.size)
        if slope:
            errors[k] *= np.sqrt(12.0) / (late.size * Ts)

    # The gain, and the error of a reading
    op = op[starts]
    steps = np.diff(op)
    error = float(np.sqrt(np.mean(errors**2)))
    gain = abs(float(np.polyfit(op, seen, 1)[0]))

    # in the direction of each step, so that noise is no motion; a slope's error is that of a mean
    # times the square root of 12
    way = max(gain * float(np.abs(steps).sum()), 1e-300)
    ahead = abs(float(np.sum(np.sign(steps) * moving[1:]))) / way
    doubt = 2.0 * error * np.sqrt(12.0 * steps.size) / way
    least = float(np.abs(steps[steps != 0.0]).min())
    settled = slope or ahead + doubt < _UNSETTLED
    return _Readings(op, seen, max(error, _SURE * gain * least), settled)


def _moves_beyond_noise(one: _Readings) -> bool:
    """Return whether a signal moved by more than its noise in any step."""
    return float(np.ptp(one.seen)) > SIGMAS * np.sqrt(2.0) * max(one.error, 1e-12)


def _intervals_meet(one: Interval, other: Interval) -> bool:
    return one[0] <= other[1] and other[0] <= one[1]


def _explaining_bands(one: _Readings) -> _Bands:
    """Return S and J of all valves that explain the readings as well as the likeliest."""
    steps = np.abs(np.diff(one.op))
    least = float(steps[steps > 0.0].min())
    span = float(np.ptp(one.op))
    sizes = np.append(0.0, np.geomspace(_SMALLEST * least, _LARGEST * span, _SIZES))
    jumps = np.append(0.0, np.geomspace(_SMALLEST * least, _LARGEST * span, _JUMPS))
    valves = np.array([
        (S, J, side, begun)
        for S in sizes for J in jumps[jumps <= _MOST_J * S]
        for side in (-1.0, 1.0) for begun in _BEGUN
    ])  # fmt: skip
    parts = [_fit_valves(one, part) for part in np.array_split(valves, len(valves) // _AT_ONCE + 1)]
    left, lost, sure = (np.concatenate([part[k] for part in parts]) for k in range(3))
    S = valves[:, 0]

    # motion is lost between nothing and S, but for what noise makes of it
    left = np.where((lost >= -sure) & (lost <= S + sure), left, np.inf)
    best = int(np.argmin(left))
    variance = max(float(left[best]) / max(one.op.size - _NUMBERS, 1), one.error**2)
    kept = left <= left[best] + _WORSE * variance

    # between two distances that OP went, all S are alike
    went = np.unique(np.abs(np.subtract.outer(one.op, one.op)))
    below = went[went <= S[kept].min()].max()
    above = went[went >= S[kept].max()].min(initial=float(_LARGEST * span))
    S_of = float(below), float(above)
    lost_of = float((lost - sure)[kept].min()), float((lost + sure)[kept].max())
    J_of = max(S_of[0] - lost_of[1], 0.0), min(max(S_of[1] - lost_of[0], 0.0), S_of[1])
    moved = _last_moves(one.op, valves[best : best + 1])[1][:, 0]
    return _Bands(S_of, J_of, moved)


def _fit_valves(one: _Readings, valves: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of valves (p, 4), S, J, last direction and how far OP had gone on, the squares that
    level, gain and lost motion leave of the readings, the lost motion (%), and three of its
    standard errors.
    """
    at, side = _last_moves(one.op, valves)
    X = np.stack([np.ones_like(at), at - one.op.mean(), side], axis=2)[1:]
    seen = one.seen[1:]
    A = np.einsum("npq,npr->pqr", X, X)
    b = np.einsum("npq,n->pq", X, seen)
    A += 1e-9 * np.trace(A, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    weights = np.linalg.solve(A, b[..., None])[..., 0]
    left = ((seen[:, None] - np.einsum("npq,pq->np", X, weights)) ** 2).sum(axis=0)
    gain = np.where(np.abs(weights[:, 1]) > 1e-12, weights[:, 1], np.inf)
    variance = np.maximum(left / max(seen.size - _NUMBERS, 1), one.error**2)
    sure = 6.0 * np.sqrt(variance * np.linalg.inv(A)[:, 2, 2]) / np.abs(gain)
    return left, -2.0 * weights[:, 2] / gain, sure


def _last_moves(op: np.ndarray, valves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return OP (%) at which each valve last moved, and the direction, in every hold (n, p)."""
    # Each valve stands off OP as it last moved
    S, J, side, begun = valves.T
    at = op[0] - side * begun * S
    where = np.empty((op.size, len(S)))
    ways = np.empty((op.size, len(S)))

    # It moves where OP has gone past its band, or its jump in the same direction
    for k, now in enumerate(op):
        away = now - at
        band = np.where(np.sign(away) == side, J, S)
        goes = np.abs(away) > band * (1.0 + _APART) + _APART
        at = np.where(goes, now, at)
        side = np.where(goes, np.sign(away), side)
        where[k] = at
        ways[k] = side
    return where, ways


def _phase_of_samples(
    op: np.ndarray, starts: np.ndarray, lengths: np.ndarray, bands: _Bands | None
) -> np.ndarray:
    """Return of every sample 1, or 2 in a hold in which the valve turned; 0 outside of holds."""
    phase = np.zeros(op.size, dtype=int)
    if bands is not None:
        turned = np.append(False, np.diff(bands.moved) != 0.0)
        for start, length, back in zip(starts, lengths, turned, strict=True):
            phase[start : start + length] = 2 if back else 1
    return phase


def _in_words(bands: _Bands | None, increment: float, settled: bool) -> tuple[bool | None, str]:
    """Return whether the valve sticks, None where that is open, and why; `increment` is the
    smallest step (%).
    """
    # PV that never moved says nothing
    if bands is None:
        return None, "PV did not move on any step: the valve stands, or noise hides what it does"
    lo, hi = bands.S
    J = bands.J

    # A band wider than the steps is seen for sure
    if lo > (1.0 - _SURE) * increment and settled:
        sizes = (
            f"stick band S = {_middle_of(bands.S):.3g} % ({lo:.3g} to {hi:.3g}), slip-jump J ="
            f" {_middle_of(J):.3g} % ({J[0]:.3g} to {J[1]:.3g})"
        )
        return True, f"the valve sticks: {sizes}"

    # A band that small steps would have shown is absent
    if lo < increment and hi <= min(2.0 * increment, _HARMLESS):
        return False, f"PV follows small steps both ways: S is at most {hi:.3g} %"
    if lo < increment and hi <= 2.0 * increment:
        return None, (
            f"PV follows steps of {increment:.3g} % both ways: S is at most {hi:.3g} %, and smaller"
            " steps tell more"
        )

    # PV that still moved is no reading
    if not settled:
        return None, (
            "PV had not settled when the next step came, which looks like lost motion: larger"
            " steps, or longer holds, are needed"
        )
    return None, (
        f"in this noise, and with steps this large, PV shows no valve that moves by less than"
        f" {hi:.2g} %: larger steps, or longer holds, are needed"
    )


def _middle_of(x: Interval) -> float:
    return 0.5 * (x[0] + x[1])
