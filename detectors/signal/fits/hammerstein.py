"""Hammerstein identification: estimate the valve (S, J) and the linear plant downstream of it that
best explain PV from OP.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from simbench.detectors.compiled import compiled, quick
from simbench.detectors.signal.conditioning import median
from simbench.detectors.signal.fits.hammerstein_kernels import (
    MOVING_UP,
    VALVES_SIDE_BY_SIDE,
    Stretch,
    Valves,
    descend,
    errors,
    keep_apart,
)
from simbench.detectors.signal.oscillation import detrend

_SAMPLES = 50  # per period at least, of valve position and PV after averaging
# Periods and averaged samples looked at: the search wants few, since one missed jump spoils all
# that follow; the end, many.
SHORT = (8, 360)
_FULL = (24, 700)
# time constants tried, in periods; an integrator besides
_TIMES = np.array([0.01, 0.04, 0.1, 0.25, 0.7])
# of the swing of OP
_S_SHARES = np.concatenate([np.geomspace(0.04, 0.55, 6), np.linspace(0.64, 1.0, 10)])
_J_SHARES = np.array([0.05, 0.35, 0.8, 1.3])  # of S
S_FINE = np.concatenate([np.geomspace(0.04, 0.45, 8), np.linspace(0.48, 1.0, 27)])
_J_FINE = np.array([0.03, 0.15, 0.25, 0.35, 0.45, 0.6, 0.75, 0.9, 1.0, 1.1, 1.25, 1.4])
_J_PROFILE = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.25)  # of S
# share of the variance of PV below which errors say nothing: sampling, rounding
_LEAST_ERROR_SHARE = 2e-4
_PASSES = 2  # of the dense grid, each with the best plant so far
_TOP = 4  # candidates kept
_AGAIN = 128  # valves tried again
# whether a moving valve stops within every sample: Choudhury's map, He's; searched abreast
_MAPS = np.array([[0.0], [1.0]])
_ROWS = np.arange(2)[:, None]
_REST_POSITIONS = (0.0, -0.5, 0.5)  # rest positions tried, as shares of the break-away band
# times the inverse of a time constant
_AROUND = np.array([1.0, 0.5, 0.63, 0.79, 1.0, 1.26, 1.59, 2.0])


@dataclass(frozen=True)
class _Hammerstein:
    """A sticky valve and a first-order or integrating plant that turn OP into PV."""

    S: float  # of the best model, in the unit of OP
    J: float
    # mean squared, over the variance of PV, drift left out; then the same with S = J = 0
    error: float
    error_linear: float
    sign: float  # of the plant's gain, +1 or -1
    T_s: float  # s; inf = integrating
    Td_s: float
    search: _Search
    ends: _Ends  # where it ended under each map

    @cached_property
    def _ranges_of_sizes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return _ranges_of_sizes(self.search, self.ends)

    @property
    def S_range(self) -> tuple[float, float]:
        """Values of S that fit about as well under either map: which of them a valve follows is not
        known.
        """
        S, _, inside = self._ranges_of_sizes
        both = np.append(S[inside], self.ends.S)
        return float(both.min()), float(both.max())

    @property
    def J_range(self) -> tuple[float, float]:
        """Values of J that fit about as well under the better map."""
        _, J, inside = self._ranges_of_sizes
        best = self.ends.error.argmin()
        J = J[best][inside[best]]
        return float(J.min()), float(J.max())


class _Search:
    """One record made ready, and the kernels with its arguments filled in."""

    def __init__(
        self,
        op: np.ndarray,
        pv: np.ndarray,
        period: float,
        limits: tuple[float, float],
        reach: tuple[int, int],
    ) -> None:
        self.q = q = max(1, int(period / _SAMPLES))
        self.period = period / q
        start, stop = strongest_segment(
            op, period, min(op.size, int(reach[0] * period), reach[1] * q)
        )

        # from the highest OP of the first cycle on: there a cycling valve has just been moving up
        start += int(np.argmax(op[start : start + max(min(round(period), (stop - start) // 4), 1)]))
        n = (stop - start) // q

        # a copy: kernels would be compiled anew for read-only arrays
        self.op = np.array(op[start : start + n * q], dtype=float)
        y = pv[start : start + n * q].reshape(n, q).mean(axis=1)
        half = max(round(self.period / 2), 1)

        # the valve of one sample acts on PV in the next; after averaging, within the same
        least = 1 if q == 1 else 0
        self.delays = np.arange(least, least + max(round(0.6 * self.period), 2))
        first = min(round(0.3 * n), round(2.5 * self.period)) + int(self.delays[-1]) + 1

        # a controller lowers OP when PV rises if the plant's gain is positive
        self.sign = 1.0 if np.diff(op[start:stop]) @ np.diff(pv[start:stop]) < 0 else -1.0
        self.swing = swing(self.op, period) or float(np.ptp(self.op)) or 1.0
        self.cycles = (n - first - half) / self.period
        self.stretch = Stretch(
            self.op,
            y - moving_mean(y, half),
            q,
            half,
            first,
            n - half,
            self.sign,
            *map(float, limits),
        )

    def poles(self, times: np.ndarray) -> np.ndarray:
        """Poles of time constants given in periods."""
        return np.exp(-1.0 / np.maximum(times * self.period, 1e-3))

    def scan(
        self, stops, S, J, start, pole, low, count, stride: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return error and delay index of every valve with its pole, best of delays low, low +
        stride ...; arrays broadcast.
        """
        # One row of numbers per valve, of whatever shape they come in
        parts = (stops, S, J, start, pole)
        shape = np.broadcast(*parts).shape
        table = np.empty((5,) + shape)
        windows = np.empty((2,) + shape, dtype=np.int64)
        for i, values in enumerate(parts):
            table[i] = values
        windows[0] = low
        windows[1] = count

        # All valves in one call of the kernel
        valves = table.reshape(5, -1)
        first, counts = windows.reshape(2, -1)
        out = np.empty((counts.size, 2))
        own = Valves(*valves, first + self.delays[0], counts)
        compiled(errors)(self.stretch, own, stride, out)

        # The delay's index in the search, in the shape that was asked
        at = windows[0] + stride * out[:, 1].astype(np.int64).reshape(shape)
        return out[:, 0].reshape(shape), at

    def window(self, d: np.ndarray, reach: int) -> tuple[np.ndarray, np.ndarray]:
        """Return first index and number of the delays within `reach` of those with index `d`."""
        low = np.maximum(d - reach, 0)
        return low, np.minimum(d + reach + 1, self.delays.size) - low

    def descend(self, ends: _Ends, width, least, reach: int, fixed_J=False) -> _Ends:
        """Return the bottoms of the valleys, steps from `width` down to `least` shares of the
        swing; starts and delays stay.
        """
        # Coordinates of every end: S, J and the logarithm of the lag's rate
        m = ends.d.size
        shape = ends.d.shape
        pole = ends.pole.ravel()
        points = np.full((m, 3), -np.inf)
        steps = np.empty((m, 3))
        points[:, 0] = ends.S.ravel()
        points[:, 1] = ends.J.ravel()
        finite = (pole > 0.0) & (pole < 1.0)
        points[finite, 2] = np.log(-np.log(pole[finite]))

        # Steps of the first pattern; a lag at an end of its range is kept
        wide = np.full(shape, width).ravel()
        error = np.empty(m)
        steps[:, 0] = wide * self.swing
        steps[:, 1] = np.where(np.full(shape, fixed_J).ravel(), 0.0, steps[:, 0])
        steps[:, 2] = np.where(finite, 2.0 * wide, 0.0)

        # The valves to begin with, and one search for each
        low, count = self.window(ends.d.ravel(), reach)
        maps = np.full(shape, _MAPS).ravel()
        start = np.full(shape, ends.start).ravel()
        share = np.full(shape, np.divide(least, width)).ravel()
        begin = Valves(maps, *points.T[:2].copy(), start, pole, self.delays[low], count)
        quick(descend, errors)(self.stretch, begin, points, steps, share, error)

        # What was found, as ends again
        S = points[:, 0]
        J = points[:, 1]
        pole = np.exp(-np.exp(points[:, 2]))
        return ends._replace(
            **{
                k: x.reshape(shape)
                for k, x in (("error", error), ("S", S), ("J", J), ("pole", pole))
            }
        )


def fit_hammerstein(
    op: np.ndarray,
    pv: np.ndarray,
    period: float,
    integrating: bool = False,
    limits=(0.0, 100.0),
    Ts: float = 1.0,
) -> _Hammerstein:
    """Find the valve's S and J and the downstream plant from OP and PV.

    Source: Srinivasan, Rengaswamy, Narasimhan & Miller (2005), Ind. Eng. Chem. Res. 44, 6719-6728,
    and Jelali (2008), J.
    Process Control 18, 632-642: for every (S, J) of a grid the valve model turns OP into MV, the
    linear part is fitted in closed form, and the smallest error wins. Here the linear part is an
    output-error model (time constant and dead time from a grid, gain by least squares): its error
    is not blurred by noise on PV as that of an ARX model is. The unknown state of the valve at the
    start is searched with the rest. In the regime where the valve only toggles between two
    positions J and the plant's gain trade off: `J_range` is then wide. Not for loops whose PV is
    moved by disturbances more than by the valve: `error` is then large.
    """
    short = _Search(op, pv, period, limits, SHORT)
    full = _Search(op, pv, period, limits, _FULL)
    if integrating:
        poles = np.array([1.0])
    else:
        poles = np.append(full.poles(_TIMES), 1.0)

    # a valve without friction follows OP under either map
    linear = float(full.scan(0.0, 0.0, 0.0, MOVING_UP, poles, 0, full.delays.size)[0].min())
    ends = _fit_best_map(short, full, poles)
    best = int(ends.error.argmin())
    error, S, J, _, pole, d = (float(x[best, 0]) for x in ends)
    if pole == 1.0:
        T = np.inf
    else:
        T = -full.q * Ts / np.log(pole)
    return _Hammerstein(S, J, error, linear, full.sign, float(T), d * full.q * Ts, short, ends)


def _fit_best_map(short: _Search, full: _Search, poles: np.ndarray) -> _Ends:
    """The best end under either map."""
    # A coarse grid of valves with every pole and every other delay
    everywhere = full.delays.size
    integrating = poles.size == 1
    S, J = _grid_of_valves(_GRID, full.swing)
    stride = max(1, everywhere // 8)
    grid = _MAPS[:, None], S[:, None], J[:, None], MOVING_UP, poles[:, None]
    tried, at = short.scan(*grid, 0, -(-everywhere // stride), stride)
    which = tried.argmin(axis=1)
    column = np.arange(S.shape[1])
    tried = tried[_ROWS, which, column]
    at = at[_ROWS, which, column]

    # The best that lie apart, with better plants
    kept = _distinct_best(tried, S, J, 4)
    S = S[_ROWS, kept]
    J = J[_ROWS, kept]
    tried = tried[_ROWS, kept]
    which = which[_ROWS, kept]
    at = at[_ROWS, kept]
    ends = _improve_plants(short, _Ends.at(tried, S, J, poles[which], at), integrating)

    # noise on OP cuts valleys of 1 % of S: a dense grid with a good plant finds them, a descent
    # does not
    S, J = _grid_of_valves(_FINE_GRID, full.swing)
    for _ in range(_PASSES):
        best = ends.best(1)
        low, count = short.window(best.d, 1)
        # one map at a time: valves that share a window of delays stand side by side
        rows = zip(_MAPS, S, J, best.pole, low, count, strict=True)
        tried = np.array(
            [short.scan(stops, s, j, MOVING_UP, *plant)[0] for stops, s, j, *plant in rows]
        )
        kept = _distinct_best(tried, S, J, 4)
        pole = np.repeat(best.pole, 4, axis=1)
        d = np.repeat(best.d, 4, axis=1)
        more = _Ends.at(tried[_ROWS, kept], S[_ROWS, kept], J[_ROWS, kept], pole, d)
        ends = _settle_ends(short, ends.and_(more).best(_TOP), integrating, 0.006)
        again = np.argsort(tried, axis=1, kind="stable")[:, :_AGAIN]
        S = S[_ROWS, again]
        J = J[_ROWS, again]

    # The full record, ever finer
    ends = _improve_plants(full, _restart_ends(full, ends), integrating).best(2)
    ends = _settle_ends(full, ends, integrating, 0.004).best(1)
    return _settle_ends(full, ends, integrating, 0.001)


class _Ends(NamedTuple):
    """Candidates, arrays of a row for each map: error, valve (S, J), its start, the plant's pole
    and the index of its delay.
    """

    error: np.ndarray
    S: np.ndarray
    J: np.ndarray
    start: np.ndarray
    pole: np.ndarray
    d: np.ndarray

    @classmethod
    def at(cls, error, S, J, pole, d) -> _Ends:
        """Candidates whose valve has been moving up."""
        return cls(error, S, J, np.full(S.shape, MOVING_UP), pole, d)

    def and_(self, other: _Ends) -> _Ends:
        """These candidates and others."""
        return _Ends(*(np.concatenate(pair, axis=1) for pair in zip(self, other, strict=True)))

    def best(self, count: int) -> _Ends:
        """The best of them under each map."""
        kept = np.argsort(self.error, axis=1, kind="stable")[:, :count]
        return _Ends(*(x[_ROWS, kept] for x in self))

    def better(self, other: _Ends) -> _Ends:
        """The better of every pair of candidates."""
        return _Ends(
            *(
                np.where(other.error < self.error, new, old)
                for old, new in zip(self, other, strict=True)
            )
        )


def _combine_shares(S: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.tile(np.repeat(S, shares.size), (2, 1)), np.tile(shares, (2, S.size))


_GRID = _combine_shares(_S_SHARES, _J_SHARES)
_FINE_GRID = _combine_shares(S_FINE, _J_FINE)


def _grid_of_valves(
    shares: tuple[np.ndarray, np.ndarray], swing: float
) -> tuple[np.ndarray, np.ndarray]:
    """S and J of every combination of shares of the swing and of S, a row for each map."""
    S = shares[0] * swing
    return S, S * shares[1]


def _distinct_best(errors: np.ndarray, S: np.ndarray, J: np.ndarray, count: int) -> np.ndarray:
    """Indices of the best candidates of each row that are not next to a better one."""
    kept = np.empty((len(errors), count), dtype=np.int64)
    quick(keep_apart)(errors.copy(), np.log(S), J / S, kept)
    return kept


def _improve_plants(search: _Search, ends: _Ends, integrating: bool) -> _Ends:
    """Improve the plants downstream of the valves: time constants around the present ones, any
    delay.
    """
    # Time constants around the present ones; an integrator has none
    fine = ends.pole[..., None]
    if not integrating:
        fine = np.exp(np.log(np.clip(fine, 1e-9, 0.9999)) * _AROUND)
        fine[..., 0] = ends.pole

    # Every time constant with every delay
    error, d = search.scan(
        _MAPS[:, None],
        *(x[..., None] for x in (ends.S, ends.J, ends.start)),
        fine,
        0,
        search.delays.size,
    )

    # The best of each end
    column = np.arange(ends.d.shape[1])
    k = error.argmin(axis=2)
    return ends._replace(
        error=error[_ROWS, column, k], pole=fine[_ROWS, column, k], d=d[_ROWS, column, k]
    )


def _restart_ends(
    search: _Search,
    ends: _Ends,
    starts: tuple[float, ...] = ((MOVING_UP,) + _REST_POSITIONS),
    reach: int = 1,
) -> _Ends:
    """The candidates with those start states that suit this stretch best."""
    column = np.arange(ends.d.shape[1])
    # a whole group shares its window of delays
    tried = np.resize(starts, (column.size, VALVES_SIDE_BY_SIDE))
    low, count = search.window(ends.d, reach)
    S = ends.S[..., None]
    J = ends.J[..., None]
    pole = ends.pole[..., None]
    low = low[..., None]
    count = count[..., None]
    error, _ = search.scan(_MAPS[:, None], S, J, tried, pole, low, count)
    k = error.argmin(axis=2)
    return ends._replace(error=error[_ROWS, column, k], start=tried[column, k])


def _settle_ends(search: _Search, ends: _Ends, integrating: bool, least: float) -> _Ends:
    """Improve plants, valves and start states in turn."""
    ends = search.descend(_improve_plants(search, ends, integrating), 4.0 * least, least, 2)
    rest = _restart_ends(search, ends, _REST_POSITIONS, 2)
    moving = ends.start == MOVING_UP
    return ends.better(rest._replace(error=np.where(moving, rest.error, np.inf)))


def _ranges_of_sizes(search: _Search, best: _Ends) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """S, J and whether they fit about as well, a row for each map: for each J of a list, S and the
    plant make up for it.
    """
    start = _restart_ends(search, best)

    # first the valley itself, then one for every J
    ends = _Ends(*(np.repeat(x, 1 + len(_J_PROFILE), axis=1) for x in start))
    ends.J[:, 1:] = np.array(_J_PROFILE) * ends.S[:, 1:]
    fixed = np.arange(ends.d.shape[1]) > 0
    tried = search.descend(
        ends, np.where(fixed, 0.05, 0.02), np.where(fixed, 0.012, 0.005), 3, fixed
    )

    # every half cycle counts as one independent piece of evidence
    least = (
        tried.error.min(axis=1, keepdims=True) * (1.0 + 3.84 / max(2.0 * search.cycles, 4.0))
        + _LEAST_ERROR_SHARE
    )
    inside = tried.error <= least
    S = np.concatenate((tried.S, best.S), axis=1)
    J = np.concatenate((tried.J, best.J), axis=1)
    inside = np.concatenate((inside, inside[:, :1]), axis=1)
    return S, J, inside


def strongest_segment(x: np.ndarray, period: float, length: int) -> tuple[int, int]:
    """Return the stretch of a signal with the largest covariance with itself one period later:
    large and regular.
    """
    lag = round(period)
    room = length - lag
    if length >= x.size or room < 1:
        return 0, x.size
    x = detrend(x)
    total = np.concatenate([[0.0], np.cumsum(x[lag:] * x[:-lag])])
    start = int(np.argmax(total[room:] - total[:-room]))
    return start, start + length


def swing(op: np.ndarray, period: float) -> float:
    """Return the usual peak-to-peak of OP within a period, in its unit."""
    size = min(max(round(period), 2), op.size)
    cycles = op[: op.size // size * size].reshape(-1, size)
    return median(cycles.max(axis=1) - cycles.min(axis=1))


def moving_mean(x: np.ndarray, half: int) -> np.ndarray:
    """Return the mean over `half` samples on either side of each sample, the window cut at the
    ends, shape (n,).
    """
    total = np.concatenate([[0.0], np.cumsum(x)])
    k = np.arange(x.size)
    lo = np.maximum(k - half, 0)
    hi = np.minimum(k + half + 1, x.size)
    return (total[hi] - total[lo]) / (hi - lo)
