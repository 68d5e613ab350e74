"""Oscillation: is there a sustained one, how regular is it, what is its period, and where is it
most regular?

Published measures: the regularity of the zero crossings of the autocorrelation function, ACF
(Thornhill, Huang & Zhang 2003), the decay ratio of the ACF (Miao & Seborg 1999) and the integrated
absolute error between crossings (Hagglund 1995).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from simbench.detectors.compiled import quick
from simbench.detectors.signal.autocorrelation import (
    decay_and_lasting,
    detrend,
    detrended,
    fast_size,
    zero_crossings,
)
from simbench.detectors.signal.conditioning import snapped

_CROSSINGS = 11  # Thornhill 2003: the first 11 zero crossings of the ACF, 10 intervals
_REGULAR = 1.0  # r > 1: the spread of the intervals is below a third of their mean
# R > 0.5: the ACF loses less than half of its swing per half period (Miao & Seborg 1999)
_DECAY = 0.5
# amplitude of the last third over that of the first: below it, a transient has died out
LASTING = 1.0 / 3.0
_HIGH_PASS = (
    1 / 6,
    1 / 18,
    1 / 54,
)  # moving means removed before a further look, as shares of the record
_SHORTEST_MEAN = 20  # samples; a shorter moving mean would leave nothing but noise
# own, from simulated loops: swings of OP that count whichever least size they need, over a factor
# of it, and are alike
# shares of OP's range tried as the least swing between two reversals
_LEAST_SWINGS = np.geomspace(0.08, 0.95, 30)
_BEFORE = np.tri(_LEAST_SWINGS.size, k=-1, dtype=bool)
_GAP = 1.6
_ALIKE_SWINGS = 0.3
_SWINGS = 8
_FEWER = 1.15
_STILL_ON = 2.0
# own; share of a swing's time in the middle half of its size: a triangle 1/2, a sine 1/3, a step 0
_UNDERWAY = 0.3


@dataclass(frozen=True)
class Oscillation:
    """What the front end found."""

    sustained: bool  # and lasting to the end of the record
    regularity: float  # r = (1/3) mean(Tp) / std(Tp)
    period_s: float  # NaN when none was found
    signal: str = ""  # "op" or "pv", the more regular one
    # R of Miao & Seborg, about d when the ACF shrinks by d per half period
    decay_ratio: float = float("nan")
    # amplitude in the last third of the record over that in the first
    lasting: float = float("nan")
    # of OP, of one size, of a cycle whose period wanders; 0 where the period is what was judged
    swings: int = 0

    @property
    def evidence(self) -> str:
        """The number that says whether it is sustained."""
        if self.swings:
            return (
                f"{self.swings} swings of OP of one size, whose period wanders (r ="
                f" {self.regularity:.2f})"
            )
        return f"r = {self.regularity:.2f}"


NOTHING = Oscillation(False, 0.0, float("nan"))


def find_oscillation(op: np.ndarray, pv: np.ndarray, Ts: float) -> Oscillation:
    """Find the sustained oscillation of a loop in OP or PV, whichever shows it more regularly.

    Source: as `oscillation_of`. Not for loops with two oscillations of like strength: band-pass the
    record first.
    """
    # Both signals, the more regular one
    of_op, of_pv = oscillations_of(np.array([op, pv]), Ts)
    in_pv = (of_pv.sustained, of_pv.regularity) > (of_op.sustained, of_op.regularity)
    if in_pv:
        best = replace(of_pv, signal="pv")
    else:
        best = replace(of_op, signal="op")

    if best.sustained:
        return best

    # A valve that wanders between two places counts as well
    at = wandering(op)
    if at is None:
        return best
    period = 2.0 * float(at[-1] - at[0]) / (at.size - 1)
    return replace(best, sustained=True, period_s=period * Ts, signal="op", swings=at.size - 1)


def wandering(op: np.ndarray) -> np.ndarray | None:
    """Return the reversals of a cycle whose period wanders and whose swing does not, or None where
    there is none.

    Own. A swing of OP by S sets a sticky valve free, however long it takes: swings are alike, as
    many count whether a third or a half of their size is asked for, and OP is under way all the
    time. Noise and loads have swings of every size: the more is asked for, the fewer are left;
    after a load that steps OP comes to rest. Not for loads that ramp by one size.
    """
    # A signal that stands still has no swings
    low = float(op.min())
    high = float(op.max())
    if not high > low:
        return None

    # what counts as a reversal shall not hang on the unit
    x = snapped((op - 0.5 * (low + high)) / (high - low))
    at = np.empty(x.size, dtype=np.int64)
    turn = quick(_fill_reversals)
    count = np.zeros(_LEAST_SWINGS.size)
    for i, least in enumerate(_LEAST_SWINGS):
        count[i] = turn(x, least, at) - 1
        if count[i] < _SWINGS:  # the more is asked for, the fewer are left
            break

    # [i, j]: as many are left at j as at i; before i it does not matter, and behind the last none
    # is
    held = ((count * _FEWER >= count[:, None]) & (count >= _SWINGS)) | _BEFORE
    widest = np.where(held.all(axis=1), count.size, held.argmin(axis=1)) - np.arange(
        1, count.size + 1
    )
    i = int(np.argmax(widest))
    end = i + widest[i]
    if widest[i] < 0 or _LEAST_SWINGS[end] < _GAP * _LEAST_SWINGS[i]:
        return None

    # Swings of one size, to the end of the record, with OP under way all the time
    at = at[1 : turn(x, _LEAST_SWINGS[end], at)]
    size = np.abs(np.diff(x[at]))
    time = np.diff(at)
    alike = size.std() <= _ALIKE_SWINGS * size.mean()
    lasts = op.size - at[-1] <= _STILL_ON * time.max()
    middle = np.abs(
        x[at[0] : at[-1]] - np.repeat(0.5 * (x[at[1:]] + x[at[:-1]]), time)
    ) < 0.25 * np.repeat(size, time)
    underway = np.median(np.add.reduceat(middle, at[:-1] - at[0], dtype=float) / time) >= _UNDERWAY
    if alike and lasts and underway:
        return at.copy()
    return None


def _fill_reversals(x, least, at):
    """Fill `at` with the places where a signal turns and then goes back by more than `least`;
    return their number.
    """
    # The last extremes, and which way the signal goes (0: not known yet)
    count = 0
    low = 0
    high = 0
    way = 0

    # A new high moves the high; a fall by more than `least` makes it a reversal
    for k in range(1, x.size):
        if way >= 0:
            if x[k] > x[high]:
                high = k
            elif x[high] - x[k] > least:
                at[count] = high
                count += 1
                way = -1
                low = k
                continue

        # The same below
        if way <= 0:
            if x[k] < x[low]:
                low = k
            elif x[k] - x[low] > least:
                at[count] = low
                count += 1
                way = 1
                high = k
    return count


def oscillation_of(x: np.ndarray, Ts: float = 1.0) -> Oscillation:
    """Find the sustained oscillation of one signal.

    Source: Thornhill, Huang & Zhang (2003), J. Process Control 13, 91-100, for r; Miao & Seborg
    (1999), Proc. IEEE CCA, for R. Own: a lobe of the ACF counts when it leaves the 95 % band of
    Bartlett (1946) for a signal with this ACF's first lobe, and the list of crossings ends where
    the ACF dies out. Not for fewer than three periods.
    """
    return oscillations_of(x[None], Ts)[0]


def oscillations_of(rows: np.ndarray, Ts: float = 1.0) -> list[Oscillation]:
    """Return `oscillation_of` of every row, shape (m, n): what is done to one at a time costs as
    much for several.
    """
    # A row that stands still, or is too short, does not oscillate
    rows = detrended(rows)
    n = rows.shape[1]
    best = [NOTHING] * len(rows)
    if n >= 8:
        live = np.flatnonzero(rows.any(axis=1))
    else:
        live = []
    if len(live) == 0:
        return best

    # The autocorrelation of all rows at once
    size = fast_size(n + n // 2)
    power = np.abs(np.fft.rfft(rows[live], size)) ** 2
    for i, rho in zip(live, np.fft.irfft(power, size)[:, : n // 2], strict=True):
        best[i] = _judge_acf(rows[i], rho / rho[0], Ts)

    # Those that do not oscillate are asked again without slow parts, the weakest filter first
    for i, spectrum in zip(live, power, strict=True):
        for rho in (
            ()
            if best[i].sustained
            else np.fft.irfft(spectrum * _high_passes(size, n), size)[:, : n // 2]
        ):
            best[i] = max(
                best[i],
                _judge_acf(rows[i], rho / rho[0], Ts),
                key=lambda o: (o.sustained, o.regularity),
            )
            if best[i].sustained:
                break
    return best


@lru_cache(maxsize=32)
def _high_passes(size: int, n: int) -> np.ndarray:
    """Return what taking off moving means over shares of n samples leaves of a power spectrum, a
    row for each.
    """
    f = np.arange(size // 2 + 1) / size
    rows = []
    for share in _HIGH_PASS:
        if share * n >= _SHORTEST_MEAN:
            rows.append((1.0 - np.sinc(f * share * n)) ** 2)
    return np.array(rows).reshape(-1, f.size)


def _judge_acf(x: np.ndarray, rho: np.ndarray, Ts: float) -> Oscillation:
    first = int(np.argmax(rho < 0.0))
    band = 1.96 * math.sqrt((1.0 + 2.0 * float(rho[1:first] @ rho[1:first])) / x.size)
    at = zero_crossings(rho, band, _CROSSINGS)
    lobes = (at[1:] - at[:-1]).tolist()

    # the list ends where the ACF has died out
    if len(lobes) > 2:
        longest = 2.0 * sorted(lobes[:3])[1]
    else:
        longest = 0.0
    kept = next((i for i, lobe in enumerate(lobes) if lobe > longest), len(lobes))
    if kept < 3:
        return NOTHING
    Tp = 2.0 * np.array(lobes[:kept])
    period = float(np.add.reduce(Tp)) / kept
    off = Tp - period
    r = period / max(3.0 * math.sqrt(float(np.add.reduce(off * off)) / (kept - 1)), 1e-6 * period)
    R, lasts = quick(decay_and_lasting)(rho, at, x, period)
    return Oscillation(
        r > _REGULAR and R > _DECAY and lasts > LASTING, r, period * Ts, "", R, lasts
    )


def regular_segment(x: np.ndarray, period: float, length: int) -> tuple[int, int]:
    """Return the stretch of a signal in which it repeats itself best after one period.

    Source: step 3 of Choudhury, Shah, Thornhill & Shook (2006), which compares r over a few
    segments; here the normalised correlation with the signal one period later is compared over
    every start, in one pass. Not for length below two periods: nothing to compare.
    """
    # The normalised product with itself one period later, over every stretch
    n = x.size
    lag = round(period)
    room = length - lag
    if length >= n or room < 1:
        return 0, n
    x = detrend(x)
    total = np.concatenate(
        [np.zeros((3, 1)), np.cumsum([x[lag:] * x[:-lag], x[lag:] ** 2, x[:-lag] ** 2], axis=1)],
        axis=1,
    )
    both, late, early = total[:, room:] - total[:, :-room]
    start = int(np.argmax(both / np.sqrt(np.maximum(late * early, 1e-12 * room**2))))
    return start, start + length
