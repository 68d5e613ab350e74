"""Fit the valve model to recorded OP and MV alone, which model with which parameters, and by
regression to OP and PV."""

from __future__ import annotations

import cmath
import math
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy

from simbench.detectors.compiled import compiled
from simbench.detectors.signal.filters import lfilter
from simbench.detectors.signal.fits.regression import regression
from simbench.detectors.signal.lattice import written_unit
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import size_penalty
from simbench.gap.likelihood.search import refine_peaks
from simbench.gap.sensor.samples import exception_band
from simbench.gap.thresholds import OVERSHOOTS

_PEAKS = 4  # number of best points of a grid over valve maps that are refined
_SHARES = (
    0.1,
    0.05,
    0.02,
    0.01,
    0.004,
    0.001,
)  # shares of a point's numbers by which it is varied, ever finer
_STRETCH = 500  # samples in which the peaks of a map with a jump are looked for
_HOPELESS = -20.0  # nats below which nobody asks by how much
_AROUND = (-2, -1, 0, 1, 2)  # steps of a share about a point

MapFit = tuple[float, dict[str, float | str]]


class MapSearch:
    """Looks for the map from OP to MV; its answers are nats over the baseline's valve, numbers paid
    for, and parameters.

    Parameters
    ----------
    op, mv : ndarray, shape (n,)
        In %.
    Ts : float
        Sampling period (s).
    expected : ndarray, shape (n,)
        MV (%) as the baseline's valve makes it.
    band : float
        Dead-band (%) of the baseline's valve: where in it MV began is anybody's guess.
    late : int
        Samples by which the archive may have stored OP late.
    """

    def __init__(
        self,
        op: np.ndarray,
        mv: np.ndarray,
        Ts: float,
        expected: np.ndarray,
        band: float = 0.0,
        late: int = 0,
    ) -> None:
        # a copy: kernels would be compiled once more for a record's arrays, which are read-only
        self.op = op.copy()
        self.mv = np.array(mv, dtype=float)
        self.Ts = Ts
        self.late = late
        self.span = float(np.ptp(op)) or 1.0
        self.sizes = np.geomspace(0.02 * self.span, 1.5 * self.span, 50)
        # what an archive that reports by exception may hide of OP is no valve's
        hidden = exception_band(op, written_unit(op)) / np.sqrt(3.0)
        self.fine = (1e-3 * self.span) ** 2 + hidden**2
        self.healthy = min(self.level(expected), self.level(self.moved(kernels.PLAY, band, 0.0)))

    def level(self, v: np.ndarray) -> float:
        """Return n log(rms of MV less a model of it); below a thousandth of the range nobody's
        valve is known.

        MV may be logged at any time between OP's last sample and this one, or as a mean over it;
        and before OP, where that was stored late.
        """
        v = np.asarray(v, dtype=float)
        least = compiled(squares_within)(self.mv, v, -1)
        if self.late:
            least = min(least, compiled(squares_within)(self.mv, v, 1))
        return 0.5 * v.size * math.log(least / v.size + self.fine)

    def priced(self, level: float, parameters: dict[str, float | str], count: float) -> MapFit:
        """Return the answer for a model of that level with `count` fitted numbers."""
        return (
            max(float(self.healthy - level - size_penalty(self.op.size, count)), _HOPELESS),
            parameters,
        )

    def best(
        self, points: list[tuple[float, float, float]], names: tuple[str, ...], count: float
    ) -> MapFit:
        """Return the answer for the best of some levels with their numbers."""
        value, *numbers = min(points)
        return self.priced(value, {name: float(x) for name, x in zip(names, numbers)}, count)

    def moved(self, kind: int, a: float, b: float) -> np.ndarray:
        """Return OP after a compiled map that begins where MV does."""
        if kind in (kernels.PLAY, kernels.STICK, kernels.CREEP):
            first = self.mv[0] - self.op[0]
        else:
            first = 0.0
        if kind == kernels.PLAY:
            return kernels.valve(self.op, kind, a, first, 0.0)
        return kernels.valve(self.op, kind, a, b, first)

    def zoom(
        self, kind: int, names: tuple[str, ...], grid: list[tuple[float, float]], count: float
    ) -> MapFit:
        """Return the answer for a compiled map: a grid over its one or two numbers, its best points
        followed down.
        """
        return self.best(self.peaks(kind, grid), names, count)

    def slipping(
        self, kind: int, names: tuple[str, str], shares: tuple[float, ...], count: float
    ) -> MapFit:
        """Return the answer for a compiled map with a jump, J tried as shares of S.

        One slip missed spoils all that follow, and the longer a record the narrower are its peaks:
        they are looked for in a short stretch as well.
        """
        part = self.stretch()

        def scan(points: np.ndarray) -> np.ndarray:
            return -np.array([part.level(part.moved(kind, a, b)) for a, b, _ in points])

        points = np.array([(s, s * j, 0.0) for s in self.sizes for j in shares])
        near = part.peaks(
            kind, [(a, b) for a, b, _ in refine_peaks(scan, points, scan(points))[:_PEAKS]]
        )
        lowest = self.peaks(kind, [(a, b) for a, b, _ in points]) + self.peaks(
            kind, [(a, b) for _, a, b in near]
        )
        return self.best(lowest, names, count)

    def stretch(self) -> MapSearch:
        """Return the search over as many samples as are needed, where MV moves most."""
        n = self.op.size
        size = min(_STRETCH, self.op.size)
        way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.mv)))])
        starts = np.arange(0, n - size + 1, max(size // 2, 1))
        first = int(starts[np.argmax(way[starts + size - 1] - way[starts])])
        here = slice(first, first + size)
        op = self.op[here]
        mv = self.mv[here]
        return MapSearch(op, mv, self.Ts, op, late=self.late)

    def peaks(self, kind: int, grid: list[tuple[float, float]]) -> list[tuple[float, float, float]]:
        """Return level and numbers at the bottoms below the best few points of a grid: peaks are
        narrow, of several depths.
        """

        def tried(points: list[tuple[float, float]]) -> list[tuple[float, float, float]]:
            return sorted((self.level(self.moved(kind, a, b)), a, b) for a, b in points)

        lowest = []
        for _, a, b in tried(grid)[:_PEAKS]:
            for share in _SHARES:
                wide = a if kind == kernels.ZONE else b
                if b:
                    ways = _AROUND
                else:
                    ways = (0,)
                near = []
                for i in _AROUND:
                    for j in ways:
                        near.append((a * (1 + i * share / 2), b + j * share * wide))
                value, a, b = tried(near)[0]
            lowest.append((value, a, b))
        return lowest


def squares_within(mv, v, side):
    """Return the sum of squares that a model `v` leaves of MV, which lies at one share of the way
    from each sample of it to its neighbour at `side` (-1 or 1), as far as there is one.
    """
    last = v.size - 1
    along = size = 0.0
    for k in range(v.size):
        way = v[min(max(k + side, 0), last)] - v[k]
        along += (mv[k] - v[k]) * way
        size += way * way
    share = min(max(along / max(size, 1e-300), 0.0), 1.0)
    total = 0.0
    for k in range(v.size):
        left = mv[k] - v[k] - share * (v[min(max(k + side, 0), last)] - v[k])
        total += left * left
    return total


def share_of(left: np.ndarray, way: np.ndarray) -> float:
    """Return which share of a `way` (n,), from none to all, explains what is `left` (n,) best."""
    return float(np.clip(left @ way / max(float(way @ way), 1e-300), 0.0, 1.0))


def lag_signal(op: np.ndarray, tau: float, first: float | None = None) -> np.ndarray:
    """Return a signal after a first-order lag of `tau` samples, begun at `first` or at rest."""
    a = np.exp(-1.0 / tau)
    if first is None:
        start = op[0]
    else:
        start = first
    return start + lfilter([1.0 - a], [1.0, -a], op - start, (1.0 - a) * (start - op[0]))


# --- Find the valves that explain PV under a load of any spectrum, by regression.

_CYCLES = 8.0  # of which a record without a rhythm is taken to consist


class Regressed(NamedTuple):
    """What a valve with friction explains of PV in place of OP and beside it.

    `gain` (nats) of both together; `valves` (p, 3) the best of both, as in `Regression`; `cycles`
    of the record, and its `pace`, the samples per period of an oscillation, 0 where it has none.
    """

    gain: float
    valves: np.ndarray
    cycles: float
    pace: float


def friction_regressed(op: np.ndarray, pv: np.ndarray) -> Regressed:
    """Return what a valve with friction explains of PV (n,), without a model of the loop."""
    return _regress_valves(np.asarray(op, float).tobytes(), np.asarray(pv, float).tobytes())


@lru_cache(maxsize=2)  # both kinds of plant, and the conclusion, ask about the same record
def _regress_valves(op_bytes: bytes, pv_bytes: bytes) -> Regressed:
    op = np.frombuffer(op_bytes)
    pv = np.frombuffer(pv_bytes)
    swing = find_oscillation(op, pv, 1.0)
    if np.isfinite(swing.period_s):
        period = swing.period_s
    else:
        period = op.size / _CYCLES
    period = float(np.clip(period, 4, op.size / 2))
    found = [regression(op, pv, period, beside) for beside in (False, True)]
    valves = np.vstack([f.valves for f in found])
    pace = swing.period_s if swing.sustained else 0.0
    return Regressed(sum(f.gain for f in found), valves, op.size / period, pace)


# --- Fit a valve or positioner of second order without friction to recorded OP and MV: it
# overshoots, and what it does between samples looks like a band.

_TIMES = np.geomspace(0.3, 60.0, 24)  # samples, 1/omega that are tried
_CLEAR = 10.0  # nats from which a valve that overshoots is believed
_MEET = 1e-9  # 1/samples between two poles that count as one
_DAMPINGS = (0.08, 0.15, 0.3, 0.5, 0.8)


def second_order(search: MapSearch) -> MapFit:
    """Return the nats over the baseline's valve and the numbers: `tau` (s), the inverse of the
    natural frequency, and `damping`.
    """

    def level(x: np.ndarray) -> float:
        return search.level(
            lag_second_order(search.op, *np.exp(np.clip(x, -4.0, 6.0)), search.mv[0])
        )

    tried = [np.log((tau, damping)) for tau, damping in product(_TIMES, _DAMPINGS)]
    best = min(tried, key=level)
    found = scipy.optimize.minimize(
        level, best, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-2}
    )
    tau, damping = np.exp(np.clip(found.x, -4.0, 6.0))
    numbers: dict[str, float | str] = {"tau": float(tau) * search.Ts, "damping": float(damping)}
    return search.priced(float(found.fun), numbers, 2.0)


def positioner(search: MapSearch) -> MapFit | None:
    """Return nats and numbers of a valve that overshoots without friction; None where MV does not
    overshoot.
    """
    gain, numbers = second_order(search)
    if float(numbers["damping"]) > OVERSHOOTS or gain <= _CLEAR:
        return None
    return (gain, numbers)


def lag_second_order(op: np.ndarray, tau: float, damping: float, first: float) -> np.ndarray:
    """Return OP (n,) after a second-order lag under an input held over each sample, at rest at
    `first` before it.
    """
    b, a = held(tau, damping)
    # where it stands at the end of each sample, as MV is the position there
    return first + lfilter(b, a, op - first)


def held(tau: float, damping: float) -> tuple[list[float], list[float]]:
    """Return numerator and denominator in powers of 1/z of 1/(tau^2 s^2 + 2 damping tau s + 1)
    under an input held over each sample of length 1, without the sample of delay.

    Astrom and Wittenmark (1997), Computer-Controlled Systems, table 2.1.
    """
    decay = damping / tau
    turn = cmath.sqrt(damping * damping - 1.0) / tau
    one = cmath.exp(turn - decay)
    other = cmath.exp(-turn - decay)
    even = 0.5 * (one + other).real
    # at critical damping the poles meet, and (one - other)/(2 turn) is their value
    odd = decay * ((one - other) / (2.0 * turn) if abs(turn) > _MEET else one).real
    both = math.exp(-2.0 * decay)
    return [1.0 - even - odd, both - even + odd], [1.0, -2.0 * even, both]
