"""Compiled kernels of the Hammerstein identification: the error of PV for many valves, each with
its fitted plant, and the local search for the best valve.

Plain Python, their own slow twins; `simbench.detectors.compiled.compiled` gives them at full speed.
`LANES` valves are computed together.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from simbench.detectors.compiled import LANES, lanes, rows, wide

_MOST_ROUNDS = 60  # of the pattern search
_FASTEST = 700.0  # logarithm of a rate, beyond which a lag is over within a sample
TIE = 1e-12  # errors that differ by less are equal: rounding shall not choose the way
# start of a valve that has just been moving; else a rest position
MOVING_UP = 2.0
MOVING_DOWN = -2.0
# valves that share a window of delays: the trials of one point of `descend`
VALVES_SIDE_BY_SIDE = 8


class Stretch(NamedTuple):
    """The stretch of a record that a model is fitted to."""

    op: np.ndarray  # shape (n q,)
    y: np.ndarray  # PV averaged over `q` samples, without its moving mean, shape (n,)
    q: int
    half: int  # averages on either side of a moving mean
    first: int  # first of the averages that count
    last: int  # and the one after the last of them
    sign: float  # of the plant's gain
    # lo, hi: ends of travel
    lo: float
    hi: float


class Valves(NamedTuple):
    """Valves, each with its plant, one array per setting."""

    # 1 where a moving valve stops within every sample (He's map), 0 where with OP (Choudhury's)
    stops: np.ndarray
    S: np.ndarray
    J: np.ndarray
    start: np.ndarray  # as in `state_before`
    pole: np.ndarray
    delay: np.ndarray  # the first that is tried, the same within every group of valves
    count: np.ndarray  # of delays


def keep_apart(left, size, share, kept):
    """Fill `kept` with the indices of the least of `left` in each row, none next to another in
    `size` and `share`; those next to them become inf.
    """
    for row in range(kept.shape[0]):
        for i in range(kept.shape[1]):
            k = left[row].argmin()
            kept[row, i] = k
            for j in range(left.shape[1]):
                near = abs(size[row, j] - size[row, k]) <= 0.1
                if near and abs(share[row, j] - share[row, k]) <= 0.4:
                    left[row, j] = np.inf


def state_before(u, S, J, start, lo, hi):
    """Return the valve's state before OP `u`: at rest at a share of the break-away band below it,
    or moving past it.
    """
    u = min(max(u, lo), hi)
    if start == MOVING_UP:
        return (u - 0.5 * (S - J), 1.0, 1.0, u - 1e-9)
    if start == MOVING_DOWN:
        return (u + 0.5 * (S - J), -1.0, 1.0, u + 1e-9)
    return (u - start * 0.5 * (S + J), 0.0, 0.0, u)


def errors(record, valves, stride, out):
    """Fill out[i] with the least squared error of PV for valve and pole i over its delays, and
    which of them.

    The valve (S[i], J[i], start[i] as in `state_before`) turns `op` into v, averaged and freed of
    its mean as `y` is: h. The plant is x(k) = a x(k-1) + (1 - a) h(k) with a = pole[i] (a = 1:
    x(k-1) + h(k)), and PV is K0 x(k-d) + K1 x(k-d-1) + c, both gains of the given sign, d =
    delay[i] + stride (0, 1 ... count[i] - 1). The error is relative to the variance of y, both over
    the averages from `first` to before `last`.
    """
    # Rows for positions and their running sums
    wide()
    n = record.y.size
    delay = valves.delay
    v = rows(n)
    total = rows(n + 1)

    # Block by block: the window of delays that its valves share
    for block in range(0, delay.size, LANES):
        low = delay[block]
        high = delay[block]
        for i in range(block, min(block + LANES, delay.size), VALVES_SIDE_BY_SIDE):
            low = min(low, delay[i])
            high = max(high, delay[i])
        x = rows(n + high - low)

        # Positions, the lags' answers to them, and the misfit of PV
        moves(record, valves, block, v, total)
        answers(record.half, valves, low, block, v, total, x)
        _fill_misfits(record, valves.count, low, stride, block, x, out)


def moves(record, valves, block, v, total):
    """Fill `v` with the averaged positions of a block of valves less the first OP, and `total` with
    their running sums.

    The map of `simbench.detectors.signal.stiction_map`, or He's (fs = (S + J)/2, fd = (S - J)/2);
    `m` is the direction of a moving valve, 0 for one at rest.
    """
    wide()
    op = record.op
    q = record.q
    lo = record.lo
    hi = record.hi
    stops = valves.stops
    S = valves.S
    J = valves.J
    start = valves.start
    position = lanes()
    m = lanes()
    fs = lanes()
    fd = lanes()
    mean = lanes()
    run = lanes()
    halts = lanes()
    before = base = min(max(op[0], lo), hi)
    for c in range(LANES):
        i = min(block + c, S.size - 1)
        fs[c] = 0.5 * (S[i] + J[i])
        fd[c] = 0.5 * (S[i] - J[i])
        halts[c] = stops[i]
        m[c] = 1.0 if start[i] == MOVING_UP else -1.0 if start[i] == MOVING_DOWN else 0.0
        position[c] = base - start[i] * fs[c]
        run[c] = 0.0
        total[c] = 0.0
    first = True
    share = 1.0 / q
    for k in range(total.size // LANES - 1):
        for c in range(LANES):
            mean[c] = 0.0
        for j in range(k * q, k * q + q):
            u = min(max(op[j], lo), hi)
            side = 1.0 if u > before else -1.0 if u < before else 0.0
            before = u
            for c in range(LANES):
                off = u - position[c]
                breaks = 1.0 if off > fs[c] else -1.0 if -off > fs[c] else 0.0
                m[c] = (
                    m[c]
                    if m[c] != 0.0 and (first or (m[c] == side and halts[c] == 0.0))
                    else breaks
                )
                moved = min(max(u - m[c] * fd[c], lo), hi)
                position[c] = moved if m[c] != 0.0 else position[c]
                mean[c] += position[c]
            first = False
        for c in range(LANES):
            mean[c] = mean[c] * share - base
            run[c] += mean[c]
        # unsigned places: LLVM looks up those that might be negative one by one
        row = np.uintp(k * LANES)
        for c in range(LANES):
            v[row + np.uintp(c)] = mean[c]
        for c in range(LANES):
            total[row + np.uintp(LANES + c)] = run[c]


def answers(half, valves, low, block, v, total, x):
    """Fill `x` with the lags' answers to positions `v` with running sums `total`, each group late
    by its delay less `low`.
    """
    # The lag of each lane; an integrator adds up
    wide()
    pole = valves.pole
    delay = valves.delay
    a = lanes()
    gain = lanes()
    now = lanes()
    n = v.size // LANES
    for c in range(LANES):
        a[c] = pole[min(block + c, pole.size - 1)]
        gain[c] = 1.0 if a[c] == 1.0 else 1.0 - a[c]
        now[c] = 0.0

    # A position without its moving mean drives the lag
    for k in range(n):
        left = max(k - half, 0)
        right = min(k + half + 1, n)
        share = 1.0 / (right - left)
        row = np.uintp(k * LANES)
        start = np.uintp(left * LANES)
        stop = np.uintp(right * LANES)
        for c in range(LANES):
            i = np.uintp(c)
            h = v[row + i] - (total[stop + i] - total[start + i]) * share
            now[c] = a[c] * now[c] + gain[c] * h if k > 0 else 0.0

        # Each group of lanes is written late by its own delay
        for group in range(0, LANES, VALVES_SIDE_BY_SIDE):
            late = delay[min(block + group, pole.size - 1)] - low
            place = np.uintp((k + late) * LANES + group)
            for c in range(VALVES_SIDE_BY_SIDE):
                x[place + np.uintp(c)] = now[group + c]


def _fill_misfits(record, count, low, stride, block, x, out):
    """Fill `out` for a block of valves from their plants' answers; PV's two gains come from the
    normal equations.
    """
    wide()
    y = record.y
    first = record.first
    last = record.last
    sign = record.sign
    m = last - first
    sy = syy = 0.0
    for j in range(first, last):
        sy += y[j]
        syy += y[j] * y[j]
    syy -= sy * sy / m
    best = lanes()
    at = lanes()
    wanted = lanes()
    sx = lanes()
    sxx = lanes()
    sxz = lanes()
    sxy = lanes()
    szy = lanes()
    most = 0
    for c in range(LANES):
        best[c] = 1.0
        at[c] = 0.0
        wanted[c] = count[min(block + c, count.size - 1)]
        most = max(most, count[min(block + c, count.size - 1)])
    _sum_moments(record, m, first - low, x, sx, sxx, sxz, sxy)
    for i in range(most):
        top = first - low - i * stride
        if i > 0 and stride > 1:
            product(y, first, m, top, x, sxy)
        product(y, first, m, top - 1, x, szy)
        ahead = np.uintp((top - 1) * LANES)
        end = np.uintp((top + m - 1) * LANES)
        for c in range(LANES):
            new = x[ahead + np.uintp(c)]
            old = x[end + np.uintp(c)]
            # the sums of x one sample earlier
            sz = sx[c] + new - old
            szz = sxx[c] + new * new - old * old
            qxx = sxx[c] - sx[c] * sx[c] / m
            qzz = szz - sz * sz / m
            qxz = sxz[c] - sx[c] * sz / m
            qxy = sign * (sxy[c] - sx[c] * sy / m)
            qzy = sign * (szy[c] - sz * sy / m)
            det = qxx * qzz - qxz * qxz
            k0 = (qzz * qxy - qxz * qzy) / det
            k1 = (qxx * qzy - qxz * qxy) / det
            # a valve that hardly moves under an integrator: what is left of x without its mean is
            # rounding
            both = det > 1e-9 * qxx * qzz and k0 >= 0.0 and k1 >= 0.0 and qxx > 1e-6 * sxx[c]
            alone = qxy * qxy / qxx if qxy > 0.0 and qxx > 1e-9 * sxx[c] else 0.0
            error = 1.0 - (k0 * qxy + k1 * qzy if both else alone) / syy
            better = error < best[c] and i < wanted[c]
            at[c] = i if better else at[c]
            best[c] = error if better else best[c]
            sxy[c] = szy[c]
        # on to the next delay: the window moves by `stride` samples
        for late in range(stride if i + 1 < most else 0):
            p = np.uintp((top - late - 2) * LANES)
            r = np.uintp((top - late + m - 2) * LANES)
            for c in range(LANES):
                j = np.uintp(c)
                new = x[p + np.uintp(LANES) + j]
                old = x[r + np.uintp(LANES) + j]
                sx[c] += new - old
                sxx[c] += new * new - old * old
                sxz[c] += new * x[p + j] - old * x[r + j]
    for c in range(min(LANES, out.shape[0] - block)):
        out[block + c, 0] = best[c]
        out[block + c, 1] = at[c]


def _sum_moments(record, m, top, x, sx, sxx, sxz, sxy):
    """Sums of x, its square, its product with itself one sample earlier and with y, over the `m`
    samples from `top` on.
    """
    # Sums over the window, lane by lane
    wide()
    y = record.y
    first = record.first
    for c in range(LANES):
        sx[c] = sxx[c] = sxz[c] = sxy[c] = 0.0
    for j in range(m):
        row = np.uintp((top + j) * LANES)
        t = y[first + j]
        for c in range(LANES):
            now = x[row + np.uintp(c)]
            sx[c] += now
            sxx[c] += now * now
            sxz[c] += now * x[row + np.uintp(c) - np.uintp(LANES)]
            sxy[c] += now * t


def product(y, first, m, top, x, sxy):
    """Sums of the products of y and x over the `m` samples from `top` on."""
    wide()
    for c in range(LANES):
        sxy[c] = 0.0

    # four samples a turn: LLVM unrolls a shorter loop over the lanes before it could become
    # instructions for many
    whole = m - m % 4
    for j in range(0, whole, 4):
        row = np.uintp((top + j) * LANES)
        next_row = np.uintp((top + j + 1) * LANES)
        third_row = np.uintp((top + j + 2) * LANES)
        last_row = np.uintp((top + j + 3) * LANES)
        t = y[first + j]
        next_t = y[first + j + 1]
        third_t = y[first + j + 2]
        last_t = y[first + j + 3]
        for c in range(LANES):
            i = np.uintp(c)
            now = sxy[c] + x[row + i] * t + x[next_row + i] * next_t
            sxy[c] = now + x[third_row + i] * third_t + x[last_row + i] * last_t
    for j in range(whole, m):
        row = np.uintp((top + j) * LANES)
        t = y[first + j]
        for c in range(LANES):
            sxy[c] += x[row + np.uintp(c)] * t


def descend(record, begin, points, steps, least, error):
    """Go down from every row (S, J, log of the pole's rate) of `points`, in place; fill `error`. A
    rate of -inf integrates. Of the valves in `begin` stops, start, delay and count are read.

    Pattern search (Hooke and Jeeves, 1961): after a round of single steps in S, J, both together
    and log rate, the whole move is repeated as long as it pays, which follows the valleys in which
    S, J and the plant trade off; then the steps are halved, from steps[i] down to the share
    least[i] of them. All points go abreast, and the next trials of each are computed together on
    the bet that none pays; those after one that does are discarded. So the way is that of one
    trial after another.
    """
    wide()
    m = len(points)
    search = np.zeros((m, _TRIAL + 3))
    ahead = np.empty(_TRIAL + 3)
    for p in range(m):
        search[p, _AT] = _FIRST
        search[p, _WIDTH] = 1.0
        for c in range(3):
            search[p, _BASE + c] = search[p, _BEST + c] = search[p, _TRIAL + c] = points[p, c]
    room = max(m * VALVES_SIDE_BY_SIDE, LANES)
    S = np.empty(room)
    J = np.empty(room)
    pole = np.empty(room)
    out = np.empty((room, 2))
    maps = np.empty(room)
    starts = np.empty(room)
    delays = np.empty(room, dtype=np.int64)
    counts = np.empty(room, dtype=np.int64)
    active = np.arange(m)
    while active.size > 0:
        # the fewer points, the further ahead
        each = VALVES_SIDE_BY_SIDE * max(1, LANES // (VALVES_SIDE_BY_SIDE * active.size))
        for g in range(active.size):
            p = active[g]
            for c in range(ahead.size):
                ahead[c] = search[p, c]
            for t in range(g * each, (g + 1) * each):
                S[t], J[t], pole[t] = (
                    ahead[_TRIAL],
                    ahead[_TRIAL + 1],
                    # of the standard library: numpy's has other bits than compiled code
                    math.exp(-math.exp(min(ahead[_TRIAL + 2], _FASTEST))),
                )
                maps[t] = begin.stops[p]
                starts[t] = begin.start[p]
                delays[t] = begin.delay[p]
                counts[t] = begin.count[p]
                _advance_search(ahead, steps[p], least[p], np.inf)
        n = active.size * each
        valves = Valves(maps[:n], S[:n], J[:n], starts[:n], pole[:n], delays[:n], counts[:n])
        # a plain 1 would be compiled to kernels of its own
        errors(record, valves, np.int64(1), out[:n])
        going = 0
        for g in range(active.size):
            p = active[g]
            for t in range(g * each, (g + 1) * each):
                e = out[t, 0] if 0.0 < S[t] and 0.0 <= J[t] <= 1.5 * S[t] else 2.0
                lost = search[p, _AT] != _FIRST and e < search[p, _TOP] - TIE
                _advance_search(search[p], steps[p], least[p], e)
                if lost or search[p, _AT] == _DONE:
                    break
            if search[p, _AT] != _DONE:
                active[going] = p
                going += 1
        active = active[:going]
    for p in range(m):
        error[p] = search[p, ERROR]
        for c in range(3):
            points[p, c] = search[p, _BASE + c]


# one pattern search, an array: what is tried now (a step, or one of these), the width of the steps,
# rounds, the errors of the base and of the best point of this round, these two points, and the
# point that is tried
_FIRST = -2.0
_AGAIN = -1.0
_DONE = 9.0
_AT = 0
_WIDTH = 1
_ROUNDS = 2
ERROR = 3
_TOP = 4
_BASE = 5
_BEST = 8
_TRIAL = 11


def _advance_search(search, steps, least, e):
    """Take the error `e` of the point that was tried into a pattern search, and say there what to
    try next.
    """
    if search[_AT] == _DONE:
        return
    if search[_AT] == _FIRST:
        search[ERROR] = search[_TOP] = e
    elif e < search[_TOP] - TIE:
        search[_TOP] = e
        for c in range(3):
            search[_BEST + c] = search[_TRIAL + c]
    if search[_AT] < 0.0:
        search[_AT] = 0.0
        search[_ROUNDS] += 1.0
    else:
        search[_AT] += 1.0
    if search[_AT] == 8.0 or (search[_AT] == 6.0 and steps[2] == 0.0):
        if search[_TOP] < search[ERROR]:
            for c in range(3):
                was = search[_BASE + c]
                now = search[_BEST + c]
                search[_TRIAL + c] = 2.0 * now - was if steps[c] > 0.0 else now
                search[_BASE + c] = now
            search[ERROR] = search[_TOP]
            search[_AT] = _AGAIN
            return
        search[_WIDTH] *= 0.5
        for c in range(3):
            search[_BEST + c] = search[_BASE + c]
        search[_AT] = 0.0
        search[_ROUNDS] += 1.0

    # an oscillation that died out leaves a valley without end, down which ever smaller steps would
    # walk for minutes
    if search[_WIDTH] <= least or search[_ROUNDS] > _MOST_ROUNDS:
        search[_AT] = _DONE
        return
    i = int(search[_AT])
    way = search[_WIDTH] if i % 2 == 0 else -search[_WIDTH]
    for c in range(3):
        search[_TRIAL + c] = search[_BEST + c]
    if i < 2 or 4 <= i < 6:
        search[_TRIAL] += way * steps[0]
    if 2 <= i < 6:
        search[_TRIAL + 1] += way * steps[1]
    if i >= 6:
        search[_TRIAL + 2] += way * steps[2]
