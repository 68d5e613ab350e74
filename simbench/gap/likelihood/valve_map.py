"""Fit the valve model to recorded OP and MV alone: which model, with which parameters."""

from __future__ import annotations

import math

import numpy as np

from simbench.detectors.compiled import compiled
from simbench.detectors.signal.filters import lfilter
from simbench.detectors.signal.lattice import written_unit
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import size_penalty
from simbench.gap.likelihood.search import refine_peaks
from simbench.gap.sensor.samples import exception_band

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
