"""Regress PV on its own past and on the position of a valve: does one that sticks explain more
than one that follows OP?

The past of PV gives load and noise any spectrum under both hypotheses, so no oscillation has to be
explained by friction; only corners that come when OP has moved by S since it last turned speak for
it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from simbench.detectors.compiled import LANES, compiled, lanes, rows, wide
from simbench.detectors.signal.fits.hammerstein_kernels import Stretch, Valves, moves
from simbench.valve.maps import distinct_valves

_SAMPLES = 30  # per period, after averaging
_PAST = 36  # averages of PV before one that is predicted
_LATE = 12  # averages before it, of a valve or OP that it may follow
_TAPS = 2  # of them, side by side: what a lag and a dead time between two samples need
_PER_NUMBER = 6  # averages for each number of the past, at least
_FEWEST = 4  # numbers of the past, at least
# of OP's range: that of a limit cycle is little more than S, whose peak is then a few percent wide
_SIZES = np.concatenate([np.geomspace(0.04, 0.83, 17), np.linspace(0.86, 0.98, 5)])
_JUMPS = np.array([0.02, 0.2, 0.4, 0.6, 0.8, 1.0])  # of S
_NEAR = (0.08, 0.03, 0.01)  # shares of S by which the best points are varied, ever closer
_AROUND = np.array([(a, b) for a in (-1.0, -0.5, 0.0, 0.5, 1.0) for b in (-1.5, 0.0, 1.5)])
_KEPT = 3  # points that are followed
_VALVES = 6  # different ones of each map that are returned
_FOLLOWS_OP = np.zeros(3)  # a valve without friction
_NUMBERS = 3  # S, J and the map that were searched
# nats that one sample may be worth: what a wild reading, a step of the load or a wrong noise makes
# of a few samples is no evidence of a valve
_MOST = 1.0
_FLAT = 1e-9  # share of a signal's size by which it moves at least
_LEFT = 1e-4  # of OP's standard deviation, that PV's past leaves of it at least
_SMALL = 1e-6  # of a signal's standard deviation: no archive tells less
# shares of the squares of two positions and of their determinant that is left of them at least
_NEW = 1e-8
_TWO = 1e-6
_DIGITS = 9  # of an error, as a share of PV's rest: valves that differ by less are alike
_ROOM = 4_000_000  # positions that are kept at a time


class Regression(NamedTuple):
    """What a valve that sticks explains of PV beyond one that follows OP.

    `gain` (nats), the numbers searched paid for; `valves` (p, 3): S, J (unit of OP) and 1 where it
    stops within every sample (He's map), 0 where it moves on with OP (Choudhury's), the best of
    each map first.
    """

    gain: float
    valves: np.ndarray


def regression(op: np.ndarray, pv: np.ndarray, period: float, beside: bool = False) -> Regression:
    """Return the best valves between OP and PV (n,), which oscillate with a period (samples).

    The valve takes the place of OP; `beside`: PV may follow both, and the valve must add to what
    OP explains by any impulse response. Signals are averaged to some 30 samples a period; what
    counts are errors of one step ahead, each by one nat at most.
    """
    data = _average_signals(op, pv, period, beside)
    if data is None:
        return Regression(0.0, np.empty((0, 3)))
    found = _search_valves(data, float(np.ptp(op)))
    best = min(found, key=lambda f: f[1][0])[0][0]
    return Regression(_gain_of(data, best, beside), np.vstack([points for points, _ in found]))


def _average_signals(op: np.ndarray, pv: np.ndarray, period: float, beside: bool) -> _Data | None:
    """Return the averages of signals that oscillate with a period (samples), as they are
    regressed.
    """
    q = max(1, round(period / _SAMPLES))
    while q > 1 and op.size // q < _PER_NUMBER * _PAST:
        q -= 1
    return _prepare_averages(np.array(op, float), np.asarray(pv, float), q, beside)


def _gain_of(data: _Data, valve: np.ndarray, beside: bool) -> float:
    """Return the nats that a valve (S, J, stops) explains beyond one that follows OP."""
    sticky, sound = data.left(np.vstack([valve, _FOLLOWS_OP]))
    sound = data.rest if beside else sound
    return friction_nats(
        _nats_of_errors(sticky), _nats_of_errors(sound)
    ) - 0.5 * _NUMBERS * math.log(sound.size)


def friction_nats(sticky: np.ndarray, sound: np.ndarray) -> float:
    """Return the nats that friction gains over none, of each sample's log-likelihoods (n,), no
    sample counting more than one.
    """
    return float(np.clip(sticky - sound, -_MOST, _MOST).sum())


class _Data(NamedTuple):
    """OP, and averages of `q` samples in standard deviations: PV and its past as it is regressed,
    and what PV's past does not explain.
    """

    raw_op: np.ndarray
    q: int
    pv: np.ndarray  # (count,)
    op: np.ndarray  # (count,)
    # (c, n): ones, then `past` averages of PV before those that are predicted, the latest first,
    # then averages of OP
    rows: np.ndarray
    past: int
    weights: np.ndarray  # (m, c) of the rows that make orthonormal ones
    basis: np.ndarray  # (m, n) orthonormal: what PV's past spans
    rest: np.ndarray  # (n,) of PV
    shifted: np.ndarray  # (r, count): what is multiplied with the positions, see `_shift_rows`

    def errors(self, points: np.ndarray) -> np.ndarray:
        """Return the squared error that each valve (S, J, stops) leaves, at its best dead time."""
        some = LANES * max(1, _ROOM // (LANES * self.pv.size))
        parts = [points[i : i + some] for i in range(0, len(points), some)]
        return np.concatenate(
            [self._best_delay(*self._move_valves(part))[0][: len(part)] for part in parts]
        )

    def left(self, points: np.ndarray) -> list[np.ndarray]:
        """Return what each valve (S, J, stops) leaves of PV."""
        v, squares = self._move_valves(points)
        late = self._best_delay(v, squares)[1]
        return [
            self._squares_without(v[i // LANES, :, i % LANES], late[i]) for i in range(len(points))
        ]

    def _move_valves(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions of each valve (S, J, stops) and their sums, see `_average_positions`."""
        return _average_positions(self.raw_op, points, self.q, self.pv.size - self.rest.size - 1)

    def _squares_without(self, v: np.ndarray, late: int) -> np.ndarray:
        """Return what the positions (count,) of a valve leave of PV at a dead time."""
        if late < 0:
            return self.rest
        n = self.rest.size
        first = self.pv.size - n - 1 - late
        taps = np.array([v[first - tap :][:n] for tap in range(_TAPS)])
        taps -= (taps @ self.basis.T) @ self.basis
        return self.rest - np.linalg.lstsq(taps.T, self.rest, rcond=_TWO**0.5)[0] @ taps

    def _best_delay(self, v: np.ndarray, squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least squared error of PV with each valve, and the dead time at which it is
        left, -1 where PV's past knows where the valve stands; positions and their sums are those of
        `_average_positions`.
        """
        n = self.rest.size
        count = self.pv.size
        first = count - n
        whole = float(self.rest @ self.rest)
        found = self.shifted @ v

        # by dead time: the first position of each window, which came with it, and the one behind
        # its last, which went
        came = v[:, first - 1 - np.arange(_LATE + 1)]
        went = v[:, count - 1 - np.arange(_LATE + 1)]
        along = self.weights @ self._sum_products(found, came, went)
        own = came**2 - went**2
        next_to = came[:, :-1] * came[:, 1:] - went[:, :-1] * went[:, 1:]
        own[:, 0] = squares[:, 0]
        next_to[:, 0] = squares[:, 1]
        own = np.cumsum(own[:, :_LATE], axis=1) - np.einsum("bdmc,bdmc->bdc", along, along)
        both = np.cumsum(next_to[:, : _LATE - 1], axis=1)
        b = both - np.einsum("bdmc,bdmc->bdc", along[:, :-1], along[:, 1:])
        a = own[:, :-1]
        c = own[:, 1:]
        one = found[:, -_LATE:-1]
        two = found[:, -_LATE + 1 :]
        room = a * c - b * b
        with np.errstate(all="ignore"):
            pair = (one * one * c - 2.0 * one * two * b + two * two * a) / room
            # OP of a loop is a sum of PV: of two positions nothing new is left but one
            alone = np.maximum(one * one / a, two * two / c)
        explained = np.where(room > _TWO * a * c, pair, alone)

        # where PV's past knows where the valve stands nothing is new
        errors = whole - np.where(np.minimum(a, c) > _NEW * n, explained, 0.0)
        late = errors.argmin(axis=1)
        least = np.take_along_axis(errors, late[:, None], axis=1)[:, 0]
        late = np.where(least < whole, late, -1)
        return whole * np.round(least / whole, _DIGITS).ravel(), late.ravel()

    def _sum_products(self, found: np.ndarray, came: np.ndarray, went: np.ndarray) -> np.ndarray:
        """Return the products (blocks, late, c, lanes) of the rows and the positions d + 1 averages
        before those that are predicted.

        Where both are one average later, the sum has lost its last term and got one before the
        first.
        """
        c = len(self.rows)
        count = self.pv.size
        first = count - self.rows.shape[1]
        k = np.arange(1, self.past + 1)
        heads, tails = np.ones((2, c - 1))
        heads[: self.past] = self.pv[first - k]
        tails[: self.past] = self.pv[count - k]
        k = np.arange(1, c - self.past)
        heads[self.past :] = self.op[first - k]
        tails[self.past :] = self.op[count - k]
        out = np.empty((len(found), _LATE, c, LANES))
        out[:, 0] = found[:, :c]
        for d in range(1, _LATE):
            new = came[:, d, None]
            old = went[:, d, None]
            out[:, d, 0] = out[:, d - 1, 0] + came[:, d] - went[:, d]
            out[:, d, 1:] = out[:, d - 1, :-1] + heads[:, None] * new - tails[:, None] * old
            # the latest average of PV, and of OP, has none before it that is known
            out[:, d, 1] = found[:, c + d - 1]
            if c > 1 + self.past:
                out[:, d, 1 + self.past] = found[:, c + _LATE - 2 + d]
        return out


def _prepare_averages(op: np.ndarray, pv: np.ndarray, q: int, beside: bool) -> _Data | None:
    """Return the averages as they are regressed; None where there are too few, or PV or OP
    rests.
    """
    # Averages, as many past ones as their number allows
    n = op.size // q
    u = op[: n * q].reshape(n, q).mean(axis=1)
    y = pv[: n * q].reshape(n, q).mean(axis=1)
    past = min(_PAST, n // _PER_NUMBER - _FEWEST)
    first = max(past, _LATE) + 1
    if past < _FEWEST or not all(_moves_at_all(x) for x in (u, y)):
        return None

    # Both in standard deviations
    u = (u - u.mean()) / u.std()
    y = (y - y.mean()) / y.std()

    # What PV remembers, and OP where it is regressed beside
    lags = [np.ones(n - first)] + [y[first - k : n - k] for k in range(1, past + 1)]
    lags = np.array(lags + [u[first - k : n - k] for k in range(1, _LATE + 1) if beside])
    basis, weights = _orthonormal_rows(lags, 1 + past)
    rest = y[first:] - (basis @ y[first:]) @ basis
    return _Data(op, q, y, u, lags, past, weights, basis, rest, _shift_rows(lags, past, rest, n))


def _shift_rows(lags: np.ndarray, past: int, rest: np.ndarray, count: int) -> np.ndarray:
    """Return rows (r, count) that give with positions all products that are not sums of others: of
    the lags with the latest position, of the latest lag of PV, and of OP, with every earlier one,
    and of the rest of PV with all.
    """
    first = count - rest.size
    latest = [lags[1], *lags[1 + past : 2 + past]]
    every = [(row, 0) for row in lags]
    for row in latest:
        for d in range(1, _LATE):
            every.append((row, d))
    every += [(rest, d) for d in range(_LATE)]
    out = np.zeros((len(every), count))
    for place, (row, d) in zip(out, every, strict=True):
        place[first - 1 - d : count - 1 - d] = row
    return out


def _orthonormal_rows(rows: np.ndarray, of_pv: int) -> tuple[np.ndarray, np.ndarray]:
    """Return orthonormal rows (m, n) that span some rows, the first of them of PV and the others of
    OP, and what of each row (m, c) is in them.
    """
    # upright: of a matrix that lies LAPACK takes twice as long
    left, sizes, right = np.linalg.svd(rows[:of_pv].T, full_matrices=False)

    # what a smooth past repeats to this share is rounding
    kept = sizes > _SMALL * sizes[0]
    basis = left.T[kept]
    weights = np.zeros((int(kept.sum()), len(rows)))
    weights[:, :of_pv] = right[kept] / sizes[kept, None]

    # in a loop some of OP's past is a sum of PV's: what is left of it is rounding
    for k in range(of_pv, len(rows)):
        once = basis @ rows[k]
        x = rows[k] - once @ basis
        again = basis @ x
        x -= again @ basis
        size = float(np.linalg.norm(x))
        if size > _LEFT * math.sqrt(x.size):
            more = -(once + again) @ weights
            more[k] += 1.0
            basis = np.vstack([basis, x / size])
            weights = np.vstack([weights, more / size])
    return np.ascontiguousarray(basis), np.ascontiguousarray(weights)


def _moves_at_all(x: np.ndarray) -> bool:
    return float(x.std()) > _FLAT * float(np.abs(x).max())


def _search_valves(data: _Data, span: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return of each map, Choudhury's and He's, the best different valves (S, J, stops), of a grid
    and points about its best, and their errors.
    """
    S, J = np.meshgrid(span * _SIZES, _JUMPS, indexing="ij")
    valves = []
    for stops in (0.0, 1.0):
        valves.append(np.column_stack([S.ravel(), (S * J).ravel(), np.full(S.size, stops)]))
    errors = np.split(data.errors(np.vstack(valves)), 2)
    for near in _NEAR:
        more = [_valves_about(*found, near) for found in zip(valves, errors, strict=True)]
        of_more = np.split(data.errors(np.vstack(more)), 2)
        valves = [np.vstack(both) for both in zip(valves, more, strict=True)]
        errors = [np.concatenate(both) for both in zip(errors, of_more, strict=True)]
    kept = [distinct_valves(v, e, _VALVES) for v, e in zip(valves, errors, strict=True)]
    return [(v[k], e[k]) for v, e, k in zip(valves, errors, kept, strict=True)]


def _valves_about(valves: np.ndarray, errors: np.ndarray, near: float) -> np.ndarray:
    """Return valves about the best, with S that differs by a share, and J as far."""
    best = valves[np.argsort(errors, kind="stable")[:_KEPT]]
    best = np.repeat(best, len(_AROUND), axis=0)
    about = near * np.tile(_AROUND, (_KEPT, 1))
    S = best[:, 0] * (1.0 + about[:, 0])
    J = S * np.clip(best[:, 1] / best[:, 0] + about[:, 1], _JUMPS[0], _JUMPS[-1])
    return np.column_stack([S, J, best[:, 2]])


def _nats_of_errors(left: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of each error, of unknown size, but for a constant."""
    power = float(np.mean(left * left)) + _SMALL**2
    return -0.5 * (np.log(power) + left * left / power)


def _average_positions(
    op: np.ndarray, points: np.ndarray, q: int, first: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the averaged positions (blocks, n, lanes) of valves (S, J, stops), side by side, in
    standard deviations, and 0 of a valve that does not move; the last one is repeated. And sums
    (blocks, 2, lanes): of their squares, and of their products with the position before, from
    `first` to the last but one.

    The valves are those of `stiction_map`, or such as stop within every sample (`stops`), which are
    He's. S = 0: it follows OP.
    """
    # The valves side by side in blocks of lanes
    count = op.size // q
    blocks = -(-len(points) // LANES)
    S, J, stops = np.ascontiguousarray(points.T)
    at_rest = np.zeros(len(points))
    none = np.zeros(len(points), dtype=np.int64)
    valves = Valves(stops, S, J, at_rest, at_rest, none, none)

    # The record as the kernel of positions takes it
    record = Stretch(op, op, q, 0, 0, 0, 1.0, -np.inf, np.inf)
    v = rows(blocks * count).reshape(blocks, count, LANES)
    total = rows(count + 1)
    squares = np.empty((blocks, 2, LANES))

    # Positions in standard deviations; a valve that hardly moves counts as resting
    least = _FLAT * np.abs(op - op[0]).max()
    scaled = compiled(_scale_positions)
    for block, (moved, sums) in enumerate(zip(v, squares, strict=True)):
        scaled(record, valves, block * LANES, least, first, moved.reshape(-1), total, sums)
    return v, squares


def _scale_positions(record, valves, block, least, first, v, total, sums):
    """Fill `v` with the averaged positions of a block of valves in standard deviations, 0 where
    that is not above `least`, `total` as `moves` does, and `sums` as `_average_positions` says.
    """
    # The averaged positions, and their means
    wide()
    moves(record, valves, block, v, total)
    n = v.size // LANES
    mean = lanes()
    scale = lanes()
    one = lanes()
    two = lanes()
    for c in range(LANES):
        mean[c] = total[np.uintp(n * LANES + c)] / n
        scale[c] = one[c] = two[c] = 0.0

    # Deviations and their squares
    for k in range(n):
        row = np.uintp(k * LANES)
        for c in range(LANES):
            off = v[row + np.uintp(c)] - mean[c]
            v[row + np.uintp(c)] = off
            scale[c] += off * off

    # One over the standard deviation, 0 of a valve at rest
    for c in range(LANES):
        size = math.sqrt(scale[c] / n)
        if size > least:
            scale[c] = 1.0 / size
        else:
            scale[c] = 0.0

    # Positions in standard deviations
    for k in range(n):
        row = np.uintp(k * LANES)
        for c in range(LANES):
            v[row + np.uintp(c)] *= scale[c]

    # Sums of squares, and of products one sample apart
    for k in range(first, n - 1):
        row = np.uintp(k * LANES)
        before = np.uintp((k - 1) * LANES)
        for c in range(LANES):
            now = v[row + np.uintp(c)]
            one[c] += now * now
            two[c] += now * v[before + np.uintp(c)]

    # The sums, as the regression takes them
    for c in range(LANES):
        sums[0, c] = one[c]
        sums[1, c] = two[c]
