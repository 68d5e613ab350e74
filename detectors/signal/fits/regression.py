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

from simbench.detectors.compiled import compiled
from simbench.detectors.signal.stiction_map import start, step

_SAMPLES = 30  # per period, after averaging
_PAST = 36  # averages of PV before one that is predicted
_LATE = 12  # averages before it, of a valve or OP that it may follow
_TAPS = 2  # of them, side by side: what a lag and a dead time between two samples need
_PER_NUMBER = 6  # averages for each number of the past, at least
_FEWEST = 4  # numbers of the past, at least
# of OP's range, and of S
_SIZES, _JUMPS = np.geomspace(0.04, 0.98, 18), np.array([0.02, 0.2, 0.4, 0.6, 0.8, 1.0])
_NEAR = (0.08, 0.03, 0.01)  # shares of S by which the best points are varied, ever closer
_AROUND = np.array([(a, b) for a in (-1.0, -0.5, 0.0, 0.5, 1.0) for b in (-1.5, 0.0, 1.5)])
_KEPT = 3  # points that are followed
_APART = (0.08, 0.2)  # differences of log S and of J/S from which on points are different
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
_NEW, _TWO = 1e-8, 1e-6


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
    q = max(1, round(period / _SAMPLES))
    while q > 1 and op.size // q < _PER_NUMBER * _PAST:
        q -= 1
    data = _prepared(np.array(op, float), np.asarray(pv, float), q, beside)
    if data is None:
        return Regression(0.0, np.empty((0, 3)))
    found = [_searched(data, float(np.ptp(op)), stops) for stops in (0.0, 1.0)]
    best = min(found, key=lambda f: f[1][0])[0][0]
    sound = data.rest if beside else data.left(_FOLLOWS_OP)
    gain = gained(_nats(data.left(best)), _nats(sound))
    return Regression(
        gain - 0.5 * _NUMBERS * math.log(sound.size), np.vstack([points for points, _ in found])
    )


def gained(sticky: np.ndarray, sound: np.ndarray) -> float:
    """Return the nats that friction gains over none, of each sample's log-likelihoods (n,), no
    sample counting more than one.
    """
    return float(np.clip(sticky - sound, -_MOST, _MOST).sum())


class _Lags(NamedTuple):
    """Signals in standard deviations, and their past as it is regressed."""

    pv: np.ndarray  # (count,)
    op: np.ndarray  # (count,)
    # (c, n): ones, then `past` averages of PV before those that are predicted, the latest first,
    # then averages of OP
    rows: np.ndarray
    past: int
    weights: np.ndarray  # (m, c) of the rows that make orthonormal ones


class _Data(NamedTuple):
    """OP with averages of `q` samples of PV, less what its past explains."""

    raw_op: np.ndarray
    q: int
    lags: _Lags
    basis: np.ndarray  # (m, n) orthonormal: what PV's past spans
    rest: np.ndarray  # (n,) of PV

    def errors(self, points: np.ndarray) -> np.ndarray:
        """Return the squared error that each valve (S, J, stops) leaves, at its best dead time."""
        return self._tried(points)[0][:, 0]

    def _tried(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what `_errors` does, and the positions of the last valve."""
        out, v = np.empty((len(points), 2)), np.empty(self.lags.pv.size)
        compiled(_errors)(self.raw_op, points, self.q, self.lags, self.rest, out, v)
        return out, v

    def left(self, point: np.ndarray) -> np.ndarray:
        """Return what a valve (S, J, stops) leaves of PV."""
        out, v = self._tried(point[None, :])
        if out[0, 1] < 0.0:
            return self.rest
        n = self.rest.size
        first = v.size - n - 1 - int(out[0, 1])
        taps = np.array([v[first - tap :][:n] for tap in range(_TAPS)])
        taps -= (taps @ self.basis.T) @ self.basis
        return self.rest - np.linalg.lstsq(taps.T, self.rest, rcond=_TWO**0.5)[0] @ taps


def _prepared(op: np.ndarray, pv: np.ndarray, q: int, beside: bool) -> _Data | None:
    """Return the averages as they are regressed; None where there are too few, or PV or OP
    rests.
    """
    n = op.size // q
    u, y = (x[: n * q].reshape(n, q).mean(axis=1) for x in (op, pv))
    past = min(_PAST, n // _PER_NUMBER - _FEWEST)
    first = max(past, _LATE) + 1
    if past < _FEWEST or not all(_moves_at_all(x) for x in (u, y)):
        return None
    u, y = ((x - x.mean()) / x.std() for x in (u, y))
    rows = [np.ones(n - first), *(y[first - k : n - k] for k in range(1, past + 1))]
    rows = np.array([*rows, *(u[first - k : n - k] for k in range(1, _LATE + 1) if beside)])
    basis, weights = _orthonormal(rows, 1 + past)
    rest = y[first:] - (basis @ y[first:]) @ basis
    return _Data(op, q, _Lags(y, u, rows, past, weights), basis, rest)


def _orthonormal(rows: np.ndarray, of_pv: int) -> tuple[np.ndarray, np.ndarray]:
    """Return orthonormal rows (m, n) that span some rows, the first of them of PV and the others of
    OP, and what of each row (m, c) is in them.
    """
    left, sizes, right = np.linalg.svd(rows[:of_pv], full_matrices=False)
    # what a smooth past repeats to this share is rounding
    kept = sizes > _SMALL * sizes[0]
    basis, weights = right[kept], np.zeros((int(kept.sum()), len(rows)))
    weights[:, :of_pv] = (left[:, kept] / sizes[kept]).T
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
            basis, weights = np.vstack([basis, x / size]), np.vstack([weights, more / size])
    return np.ascontiguousarray(basis), np.ascontiguousarray(weights)


def _moves_at_all(x: np.ndarray) -> bool:
    return float(x.std()) > _FLAT * float(np.abs(x).max())


def _searched(data: _Data, span: float, stops: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the best different valves of one map (S, J, stops), of a grid and points about its
    best, and their errors.
    """
    S, J = np.meshgrid(span * _SIZES, _JUMPS, indexing="ij")
    points = np.column_stack([S.ravel(), (S * J).ravel(), np.full(S.size, stops)])
    errors = data.errors(points)
    for near in _NEAR:
        best = points[np.argsort(errors, kind="stable")[:_KEPT]]
        best = np.repeat(best, len(_AROUND), axis=0)
        about = near * np.tile(_AROUND, (_KEPT, 1))
        S = best[:, 0] * (1.0 + about[:, 0])
        J = S * np.clip(best[:, 1] / best[:, 0] + about[:, 1], _JUMPS[0], _JUMPS[-1])
        more = np.column_stack([S, J, best[:, 2]])
        points, errors = np.vstack([points, more]), np.append(errors, data.errors(more))
    order = np.argsort(errors, kind="stable")
    size, share = np.log(points[order, 0]), points[order, 1] / points[order, 0]
    cells = np.column_stack([size, share]) // np.array(_APART)
    first = np.sort(np.unique(cells, axis=0, return_index=True)[1])[:_VALVES]
    return points[order[first]], errors[order[first]]


def _nats(left: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of each error, of unknown size, but for a constant."""
    power = float(np.mean(left * left)) + _SMALL**2
    return -0.5 * (np.log(power) + left * left / power)


def _positions(op, S, J, stops, q, v):
    """Fill `v` with the averaged positions of a valve, in standard deviations; return whether it
    moves.

    The valve is that of `stiction_map`, or one that stops within every sample (`stops`), which is
    He's. S = 0: it follows OP.
    """
    count = v.size
    state, mean = start(op[0], -np.inf, np.inf), 0.0
    for k in range(count):
        total = 0.0
        for i in range(k * q, k * q + q):
            if stops > 0.0:
                state = (state[0], state[1], 0.0, state[3])
            state = step(op[i], state, S, J, -np.inf, np.inf)
            total += state[0]
        v[k] = total / q - op[0]
        mean += v[k] / count
    power = 0.0
    for k in range(count):
        v[k] -= mean
        power += v[k] * v[k] / count
    size = 0.0
    for k in range(op.size):
        size = max(size, abs(op[k] - op[0]))
    if not power > (_FLAT * size) ** 2:
        return False
    for k in range(count):
        v[k] /= power**0.5
    return True


def _products(v, lags, products):
    """Fill row d of `products` (late, c) with the products of `lags.rows` and a valve's positions d
    + 1 averages before those that are predicted.

    Where both are one average later, the sum has lost its last term and got one before the first.
    """
    late, n, count = products.shape[0], lags.rows.shape[1], v.size
    first = count - n
    latest = np.dot(lags.rows, v[first - 1 : count - 1])
    for j in range(latest.size):
        products[0, j] = latest[j]
    for d in range(1, late):
        came, went = v[first - 1 - d], v[count - 1 - d]
        products[d, 0] = products[d - 1, 0] + came - went
        for j in range(1, lags.rows.shape[0]):
            of_op = j > lags.past
            x, k = (lags.op, j - lags.past) if of_op else (lags.pv, j)
            if k == 1:
                products[d, j] = np.dot(lags.rows[j], v[first - 1 - d : count - 1 - d])
            else:
                products[d, j] = products[d - 1, j - 1] + came * x[first - k] - went * x[count - k]


def _errors(op, points, q, lags, rest, out, v):
    """Fill each row of `out` with the least squared error of PV with a valve of `points`, and the
    dead time at which it is left, -1 where PV's past knows where the valve stands; and `v` with the
    positions of the last of them.
    """
    n, count = rest.size, lags.pv.size
    first = count - n
    answer = np.empty(_LATE)
    products = np.empty((_LATE, lags.rows.shape[0]))
    # of positions with themselves, and with those one average earlier
    own, next_to = np.empty(_LATE), np.empty(_LATE)
    whole = np.dot(rest, rest)
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = whole, -1.0
        if not _positions(op, points[i, 0], points[i, 1], points[i, 2], q, v):
            continue
        _products(v, lags, products)
        along = np.dot(products, lags.weights.T)
        latest = v[first - 1 : count - 1]
        own[0], next_to[0] = np.dot(latest, latest), np.dot(latest, v[first - 2 : count - 2])
        for d in range(1, _LATE):
            came, went = v[first - 1 - d], v[count - 1 - d]
            own[d] = own[d - 1] + came * came - went * went
            if d + 1 < _LATE:
                next_to[d] = next_to[d - 1] + came * v[first - 2 - d] - went * v[count - 2 - d]
        for d in range(_LATE):
            answer[d] = np.dot(rest, v[first - 1 - d : count - 1 - d])
        for d in range(_LATE + 1 - _TAPS):
            a = own[d] - np.dot(along[d], along[d])
            b = next_to[d] - np.dot(along[d], along[d + 1])
            c = own[d + 1] - np.dot(along[d + 1], along[d + 1])
            if not min(a, c) > _NEW * n:
                # PV's past knows where the valve stands
                continue
            one, two = answer[d], answer[d + 1]
            room = a * c - b * b
            if room > _TWO * a * c:
                error = whole - (one * one * c - 2.0 * one * two * b + two * two * a) / room
            else:
                # OP of a loop is a sum of PV: of two positions nothing new is left but one
                error = whole - max(one * one / a, two * two / c)
            if error < out[i, 0]:
                out[i, 0], out[i, 1] = error, d
