"""Kernels of the Hammerstein identification: the error of PV for one valve and many plants, over a grid or down a valley.

The functions are plain Python, their own slow twins; `compiled` gives them at full speed.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import sha1
from pathlib import Path
from types import FunctionType

import numpy as np

from detectors.signal import stiction_map
from detectors.signal.stiction_map import trace

MOST_ROUNDS = 60  # of the pattern search
MOVING_UP, MOVING_DOWN = 2.0, -2.0  # start of a valve that has just been moving; else a rest position


def state_before(u, S, J, start, lo, hi):
    """Return the valve's state before OP `u`: at rest at a share of the break-away band below it, or moving past it."""
    u = min(max(u, lo), hi)
    if start == MOVING_UP:
        return (u - 0.5 * (S - J), 1.0, 1.0, u - 1e-9)
    if start == MOVING_DOWN:
        return (u + 0.5 * (S - J), -1.0, 1.0, u + 1e-9)
    return (u - start * 0.5 * (S + J), 0.0, 0.0, u)


def objective(op, y, q, half, first, last, sign, lo, hi, S, J, start, poles, delays):
    """Return the least squared error of PV for one valve, over poles and delays, with the index of both.

    The valve turns `op` into v, which is averaged over `q` samples and freed of its mean over `half` averages on either
    side, as `y` is already: h. The plant is x(k) = a x(k-1) + (1 - a) h(k) (a = 1: x(k-1) + h(k)), and PV is
    K0 x(k-d) + K1 x(k-d-1) + c, both gains of the given sign. The error is relative to the variance of y, both over
    the samples from `first` to before `last`. `start` as in `state_before`.
    """
    state = state_before(op[0], S, J, start, lo, hi)
    v = np.empty(op.size)
    trace(op, S, J, state, lo, hi, v)
    n = y.size
    h = np.empty(n)
    x = np.empty(n)
    for k in range(n):
        total = 0.0
        for j in range(k * q, k * q + q):
            total += v[j]
        x[k] = total / q
    total = 0.0
    left = right = 0
    for k in range(n):
        while right < n and right <= k + half:
            total += x[right]
            right += 1
        while left < k - half:
            total -= x[left]
            left += 1
        h[k] = x[k] - total / (right - left)
    ys = y[first:last]
    m = ys.size
    sy = syy = 0.0
    for j in range(m):
        sy += ys[j]
        syy += ys[j] * ys[j]
    syy -= sy * sy / m
    best, best_pole, best_delay = 1.0, 0, 0
    for p in range(poles.size):
        a = poles[p]
        b = 1.0 if a == 1.0 else 1.0 - a
        x[0] = 0.0
        for k in range(1, n):
            x[k] = a * x[k - 1] + b * h[k]
        for i in range(delays.size):
            xs = x[first - delays[i] : last - delays[i]]
            zs = x[first - delays[i] - 1 : last - delays[i] - 1]
            sx = sxx = sxy = sxz = szy = 0.0
            for j in range(m):
                sx += xs[j]
                sxx += xs[j] * xs[j]
                sxy += xs[j] * ys[j]
                sxz += xs[j] * zs[j]
                szy += zs[j] * ys[j]
            # the sums of zs are those of xs one sample earlier
            sz = sx + zs[0] - xs[m - 1]
            szz = sxx + zs[0] * zs[0] - xs[m - 1] * xs[m - 1]
            sxx -= sx * sx / m
            szz -= sz * sz / m
            sxz -= sx * sz / m
            sxy = sign * (sxy - sx * sy / m)
            szy = sign * (szy - sz * sy / m)
            det = sxx * szz - sxz * sxz
            explained = 0.0
            if det > 1e-9 * sxx * szz:
                k0 = (szz * sxy - sxz * szy) / det
                k1 = (sxx * szy - sxz * sxy) / det
                if k0 >= 0.0 and k1 >= 0.0:
                    explained = k0 * sxy + k1 * szy
            if explained == 0.0 and sxy > 0.0 and sxx > 0.0:
                explained = sxy * sxy / sxx
            error = 1.0 - explained / syy
            if error < best:
                best, best_pole, best_delay = error, p, i
    return best, best_pole, best_delay


def scan(op, y, q, half, first, last, sign, lo, hi, S, J, start, poles, delays, out):
    """Fill out[i] with (error, pole index, delay index) of the valve S[i], J[i]."""
    for i in range(S.size):
        e, p, d = objective(op, y, q, half, first, last, sign, lo, hi, S[i], J[i], start, poles, delays)
        out[i, 0], out[i, 1], out[i, 2] = e, p, d


def at_point(op, y, q, half, first, last, sign, lo, hi, point, start, delays, pole):
    """Return the error at (S, J, log of the pole's rate); 2 outside 0 < S, 0 <= J <= 1.5 S. A rate of -inf integrates."""
    S, J = point[0], point[1]
    if S <= 0.0 or J < 0.0 or J > 1.5 * S:
        return 2.0
    pole[0] = np.exp(-np.exp(point[2]))
    return objective(op, y, q, half, first, last, sign, lo, hi, S, J, start, pole, delays)[0]


def descend(op, y, q, half, first, last, sign, lo, hi, point, start, delays, steps, least):
    """Go down from `point` (S, J, log rate) by pattern search, in place; return the error.

    Hooke & Jeeves (1961): after a round of single steps in S, J, both together and log rate, the whole move is repeated
    as long as it pays, which follows the valleys in which S, J and the plant trade off; then the steps are halved.
    """
    pole = np.empty(1)
    base, trial, best = point.copy(), point.copy(), point.copy()
    error = at_point(op, y, q, half, first, last, sign, lo, hi, base, start, delays, pole)
    width = 1.0
    rounds = 0
    # an oscillation that died out leaves a valley without end, down which ever smaller steps would walk for minutes
    while width > least and rounds < MOST_ROUNDS:
        best[:] = base
        top = error
        moved = True
        while moved and rounds < MOST_ROUNDS:
            rounds += 1
            for i in range(8):
                a = width if i % 2 == 0 else -width
                trial[:] = best
                trial[0] += a * steps[0] if i < 2 or 4 <= i < 6 else 0.0
                trial[1] += a * steps[1] if 2 <= i < 6 else 0.0
                trial[2] += a * steps[2] if i >= 6 else 0.0
                if i >= 6 and steps[2] == 0.0:
                    continue
                e = at_point(op, y, q, half, first, last, sign, lo, hi, trial, start, delays, pole)
                if e < top:
                    top = e
                    best[:] = trial
            moved = top < error
            if moved:
                # on from where the same move once more would lead, if that is better still
                for c in range(3):
                    trial[c] = 2.0 * best[c] - base[c] if steps[c] > 0.0 else best[c]
                base[:] = best
                error = top
                e = at_point(op, y, q, half, first, last, sign, lo, hi, trial, start, delays, pole)
                if e < top:
                    top = e
                    best[:] = trial
        width *= 0.5
    point[:] = base
    return error


@lru_cache
def compiled(name: str):
    """Return a kernel of this file compiled; sums may be reordered, so it equals the plain one to rounding only.

    Notes
    -----
    numba's disk cache watches this file alone. The valve stands in another one, so its hash is part of the kernel's name
    in the cache.
    """
    from numba import njit

    if name == "trace":
        return stiction_map.compiled(name)
    kernel = globals()[name]
    called = {n: compiled(n) for n in ("state_before", "trace", "objective", "at_point") if n in kernel.__code__.co_names}
    copy = FunctionType(kernel.__code__, {**globals(), **called}, name)
    valve = sha1(Path(stiction_map.__file__).read_bytes()).hexdigest()[:8]
    copy.__module__, copy.__qualname__ = __name__, f"{name}_{valve}"
    return njit(copy, cache=True, fastmath={"reassoc", "nsz"})
