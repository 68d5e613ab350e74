"""Compiled kernels of the diagnosis: valve models, the response of the plant, and the Kalman
filter.

Time unit is one sample throughout. What `njit_cached` compiles calls nothing of other files,
because numba's disk cache only watches this one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from simbench.detectors.compiled import compiled, njit_cached
from simbench.valve.maps import creep, play, stick, zone

IDEAL, PLAY, ZONE, STICK, CREEP, CURVE = range(6)
PINK_LOAD = -1.0  # as `load_lag`: a load of power 1/f
FRACTION = 5.0  # ratio of the time constants that add up to 1/f
# valve maps filtered together, one waits while another computes: of long records few, or ...
_FEW = 16
_MANY = 48
# ... of records up to this many samples many, which the processor's cache holds
_CACHED_SAMPLES = 5000
SKIP = 4  # first samples, which only settle the filter's unknown start
# samples after a jump of the load, over which the filter's gain follows it, or until its variance
# is ...
_REACH = 300
_SETTLED = 1e-6  # ... as constant as that from sample to sample
# samples after a jump, within which another one finds the filter still unsure of the first
_NEAR = 20


class NoiseModel(NamedTuple):
    """What moves PV besides the plant's input; times in samples, sizes in PV units.

    A load of time constants `load_time` and `load_lag` (0: first order) with steady effect `load`
    (std of its first stage), plus a random walk of `load_walk` per sample, both through the plant's
    pole `T` (0: integrating) and one of `tau` (0: none); a random walk of `walk` per sample on PV
    itself; and noise of std `noise` whose successive samples correlate by `colour`. With
    `load_lag` = PINK_LOAD the load is 1/f noise: first-order parts of equal variance, `load_time`,
    a fifth and a 25th of it (van der Ziel 1950). `spread` is the std of PV's unknown start.
    """

    T: float
    tau: float
    load_time: float
    load_lag: float
    load: float
    noise: float
    colour: float
    spread: float
    load_walk: float = 0.0
    walk: float = 0.0


class Jumps(NamedTuple):
    """Jumps of the load at each of the samples `places`, in order, and the one after it.

    Their heights are unknown, of std `size` (steady effect on PV). They stay, or fade as the load
    itself does.
    """

    places: np.ndarray
    size: float
    fade: bool = False


# whoever has no jumps passes these: a None would be compiled to kernels of its own
NO_JUMPS = Jumps(np.zeros(0, np.int64), 0.0, False)


class _Filter(NamedTuple):
    """A Kalman filter, its covariance `P` and gain, and room for its next step.

    F is mostly zeros: state `to` moves by `weight` times state `come`, row by row.
    """

    F: np.ndarray
    Q: np.ndarray
    P: np.ndarray
    h: np.ndarray
    r: float
    to: np.ndarray
    come: np.ndarray
    weight: np.ndarray
    gain: np.ndarray
    Ph: np.ndarray
    FP: np.ndarray


@njit_cached
def copied(source, target):
    """Fill an array (n,) with another one."""
    for k in range(source.size):
        target[k] = source[k]


def valve(u, kind, p0, p1, p2):
    """Return MV (n,) for OP `u` (n,) through one valve map, which has no ends of travel.

    Parameters: PLAY S, start; ZONE D, c; STICK (Choudhury) and CREEP (He) S, J, start; CURVE R.
    `start` is the offset of MV from OP before the first sample.
    """
    v = np.empty(u.size)
    compiled(_move_valve)(u, kind, float(p0), float(p1), float(p2), v)
    return v


def _move_valve(u, kind, p0, p1, p2, v):
    """Fill `v` as `valve` returns it."""
    # Each map sample by sample; the start is an offset from OP
    lo = -np.inf
    hi = np.inf
    if kind == PLAY:
        x = u[0] + p1
        for k in range(u.size):
            x = v[k] = play(u[k], x, p0, lo, hi)
    elif kind == ZONE:
        for k in range(u.size):
            v[k] = zone(u[k], p0, p1, lo, hi)
    elif kind == STICK:
        state = (u[0] + p2, 0.0, 0.0, u[0])
        for k in range(u.size):
            state = stick(u[k], state, p0, p1, lo, hi)
            v[k] = state[0]
    elif kind == CREEP:
        x = u[0] + p2
        for k in range(u.size):
            x = v[k] = creep(u[k], x, p0, p1, 1.0, lo, hi)
    elif kind == CURVE and abs(math.log(p0)) >= 1e-6:
        log_r = math.log(p0)
        for k in range(u.size):
            x = min(max(u[k], 0.0), 100.0)
            v[k] = 100.0 * math.expm1(log_r * x / 100.0) / math.expm1(log_r)
    else:
        for k in range(u.size):
            v[k] = u[k]


@njit_cached
def limit_rate(u, up, down):
    """Return u (n,) followed at no more than `up` and `down` per sample."""
    v = np.empty(u.size)
    x = u[0]
    for k in range(u.size):
        x += min(max(u[k] - x, -down), up)
        v[k] = x
    return v


@njit_cached
def _add_response(v, T, Td, out, weight):
    """Add `weight` times the answer of e^(-Td s)/(T s + 1) (T <= 0: e^(-Td s)/s) to each row of `v`
    less its start, held.
    """
    # The exact answer over a sample, with a dead time that ends within one
    delay = math.floor(Td + 1e-9)
    late = max(Td - delay, 0.0)
    if T > 0.0:
        a = math.exp(-1.0 / T)
        rest = math.exp(-(1.0 - late) / T)
        b_new = 1.0 - rest
        b_old = rest - a
    else:
        a = 1.0
        b_new = 1.0 - late
        b_old = late
    m, n = v.shape
    first = 0

    # four rows at once: one waits while the others compute
    while first + 4 <= m:
        v0 = v[first]
        v1 = v[first + 1]
        v2 = v[first + 2]
        v3 = v[first + 3]
        y0 = out[first]
        y1 = out[first + 1]
        y2 = out[first + 2]
        y3 = out[first + 3]
        x0 = x1 = x2 = x3 = old0 = old1 = old2 = old3 = 0.0
        for k in range(n):
            y0[k] += weight * x0
            y1[k] += weight * x1
            y2[k] += weight * x2
            y3[k] += weight * x3
            if k >= delay:
                j = k - delay
                new0 = v0[j] - v0[0]
                new1 = v1[j] - v1[0]
                new2 = v2[j] - v2[0]
                new3 = v3[j] - v3[0]
                x0 = a * x0 + b_old * old0 + b_new * new0
                x1 = a * x1 + b_old * old1 + b_new * new1
                x2 = a * x2 + b_old * old2 + b_new * new2
                x3 = a * x3 + b_old * old3 + b_new * new3
                old0 = new0
                old1 = new1
                old2 = new2
                old3 = new3
        first += 4

    # The rows that are left, one by one
    for i in range(first, m):
        x = old = 0.0
        for k in range(n):
            out[i, k] += weight * x
            if k >= delay:
                new = v[i, k - delay] - v[i, 0]
                x = a * x + b_old * old + b_new * new
                old = new


def plants(v, T, Td, tau):
    """Return the unit plant's answer to each row of MV `v` (m, n) as deviation from its start
    (`tau` > 0: one more pole).
    """
    out = np.zeros(v.shape)
    if tau <= 1e-3:
        _add_response(v, T, Td, out, 1.0)
    elif T > 0.0:
        if abs(tau - T) < 1e-3 * T:
            tau = T * 1.002
        _add_response(v, T, Td, out, T / (T - tau))
        _add_response(v, tau, Td, out, -tau / (T - tau))
    else:
        _add_response(v, 0.0, Td, out, 1.0)
        _add_response(v, tau, Td, out, -tau)
    return out


def plant(v, T, Td, tau):
    """Return the unit plant's answer to MV `v` (n,) as `plants` does."""
    return plants(v[None, :], T, Td, tau)[0]


def scan(u, kind, points, Td, model, rest, basis, jumps):
    """Return, of many valve maps (points, 3) at one noise model, the plant's answer times PV and
    times itself, whitened.

    `basis` (m, n) holds the whitened other channels, orthonormal, and `rest` the whitened PV less
    its part along them, both 0 in the first SKIP samples; only the plant's answer is filtered anew
    for each point.
    """
    gy, gg = np.empty((2, len(points)))
    together = _MANY if u.size <= _CACHED_SAMPLES else _FEW
    for first in range(0, len(points), together):
        some = slice(first, first + together)
        moved = np.array([valve(u, kind, *point) for point in points[some]])
        white = whiten(plants(moved, model.T, Td, model.tau), model, jumps)[0]
        white[:, :SKIP] = 0.0
        along = white @ basis.T
        gy[some] = white @ rest
        gg[some] = (white * white).sum(axis=1) - (along * along).sum(axis=1)
    return gy, gg


@njit_cached
def _step_covariance(kalman):
    """Take one step of the covariance and write the filter's gain; return the innovation's
    variance.
    """
    _, Q, P, h, r, to, come, weight, gain, Ph, FP = kalman
    s = h.size

    # the innovation's variance
    S = r
    for i in range(s):
        Ph[i] = 0.0
        for j in range(s):
            Ph[i] += P[i, j] * h[j]
        S += h[i] * Ph[i]

    # the gain F P h / S, and F P
    for i in range(s):
        gain[i] = 0.0
        for j in range(s):
            FP[i, j] = 0.0
    for q in range(to.size):
        gain[to[q]] += weight[q] * Ph[come[q]]
        for j in range(s):
            FP[to[q], j] += weight[q] * P[come[q], j]
    for i in range(s):
        gain[i] /= S

    # the next covariance, F P F' + Q less what the measurement tells
    for i in range(s):
        for j in range(s):
            P[i, j] = Q[i, j] - gain[i] * gain[j] * S
    for q in range(to.size):
        for i in range(s):
            P[i, to[q]] += FP[i, come[q]] * weight[q]
    return S


@njit_cached
def follow(kalman, level, size, gains, variances, covariances):
    """Write gain, innovation variance and covariance of the samples from a jump on; return the last
    that differs.
    """
    for i in range(_REACH):
        if i < 2:
            kalman.P[level, level] += size * size
        if i < _NEAR:
            for j in range(kalman.h.size):
                copied(kalman.P[j], covariances[i, j])
        variances[i] = _step_covariance(kalman)
        copied(kalman.gain, gains[i])
        if i > 20 and abs(variances[i] - variances[i - 1]) < _SETTLED * variances[i]:
            return i
    return _REACH - 1


@njit_cached
def _state_space(model, jumps):
    """Return what moves PV as a linear model x(k + 1) = F x(k) + w(k), PV(k) = h' x(k) + v(k): F,
    the covariance Q of w, that of x(0), h, the variance of v, and the state that jumps.

    The states, each where the model has it: the load, a first-order process of variance `load`^2
    (Q = (1 - phi^2) load^2 keeps it so); the plant, a lag of time constant T under the load, held
    over each sample (T = 0: its sum); the load's second stage between the two; two more loads that
    make 1/f noise with the first; the plant's second pole; random walks of the load and of PV; a
    load that jumps; noise that remembers its last value.
    """
    # Which states there are: load, plant, lag of the load, sensor, walks, colour, jump
    T, tau, load_time, load_lag, load, noise, colour, spread, load_walk, walk = model
    smooth = load_lag > 0.1
    parts = 3 if load_lag == PINK_LOAD else 1
    has_tau = tau > 1e-3
    coloured = abs(colour) > 0.01
    jumping = jumps.places.size > 0
    jumping = jumping and not jumps.fade
    s = 1 + parts + smooth + has_tau + (load_walk > 0.0) + (walk > 0.0) + coloured + jumping

    # A load of the memory `load_time`, a plant of one lag
    F = np.zeros((s, s))
    Q = np.zeros((s, s))
    P = np.zeros((s, s))
    h = np.zeros(s)
    phi = math.exp(-1.0 / load_time)
    if T > 0.0:
        a = math.exp(-1.0 / T)
        enters = 1.0 - a
    else:
        a = 1.0
        enters = 1.0
    F[0, 0] = phi
    F[1, 1] = a

    # A load that is itself smooth passes a lag first
    top = 2
    if smooth:
        b = math.exp(-1.0 / load_lag)
        F[2, 2] = b
        F[2, 0] = 1.0 - b
        F[1, 2] = enters
        P[2, 2] = load * load
        top = 3
    else:
        F[1, 0] = enters

    # Its variance, over as many parts as pink noise needs
    share = load * load / parts
    Q[0, 0] = share * (1.0 - phi * phi)
    P[0, 0] = share
    P[1, 1] = spread * spread
    for i in range(1, parts):
        phi = math.exp(-(FRACTION**i) / load_time)
        F[top, top] = phi
        F[1, top] = enters
        Q[top, top] = share * (1.0 - phi * phi)
        P[top, top] = share
        top += 1

    # A sensor with a lag sees the plant late
    seen = 1
    if has_tau:
        seen = top
        b = math.exp(-1.0 / tau)
        F[top, top] = b
        F[top, 1] = 1.0 - b
        P[top, top] = spread * spread
        top += 1
    h[seen] = 1.0

    # A load that walks, and a PV that walks
    if load_walk > 0.0:
        F[top, top] = 1.0
        F[1, top] = enters
        Q[top, top] = load_walk * load_walk
        top += 1
    if walk > 0.0:
        F[top, top] = 1.0
        Q[top, top] = walk * walk
        h[top] = 1.0
        top += 1

    # A jump of the load enters the plant
    level = 0
    if jumping:
        level = top
        F[top, top] = 1.0
        F[1, top] = enters
        top += 1

    # Noise with a memory is a state of its own
    r = noise * noise
    if coloured:
        F[top, top] = colour
        Q[top, top] = r * (1.0 - colour * colour)
        P[top, top] = r
        h[top] = 1.0
        r = 1e-6 * r
    return F, Q, P, h, r, level


@njit_cached
def _filter_gains(kalman, level, late, jumps, n):
    """Return the filter's gain (n, s) and innovation variance (n,) at each sample, and the sum of
    the variances' logarithms; nothing of this depends on what is measured.

    The covariance is followed until it is as good as steady, and again from each of the `jumps` of
    the state `level` on, which PV shows `late` samples later. A jump is followed by the same gains
    as the one before, unless they are close together.
    """
    # The filter's gain and variance, sample by sample
    s = kalman.h.size
    count = jumps.places.size
    jump = jumps.size
    P = kalman.P
    gain = kalman.gain
    gains = np.empty((n, s))
    variances = np.empty(n)
    room = _REACH if count > 0 else 0
    after = np.zeros((room, s))
    their_variances = np.zeros(room)
    covariances = np.zeros((min(room, _NEAR), s, s))
    S = 1.0
    sum_log = 0.0
    log_var = 0.0
    live = True
    start = 0
    last = -1
    since = -1
    upcoming = 0

    # A jump of the load wakes the filter, or repeats what it did after the last one
    for k in range(n):
        if upcoming < count and k >= jumps.places[upcoming] - late:
            upcoming += 1
            if not live and last < 0:
                last = follow(kalman, level, jump, after, their_variances, covariances)
                since = 0
            elif not live and since >= min(_NEAR, last):
                since = 0
            else:
                if not live:
                    for i in range(s):
                        copied(covariances[since, i], P[i])
                live = True
                start = k

        # A filter that has settled keeps its gain
        if live:
            if start > 0 and k - start < 2:
                # a jump between two samples is part of one at each
                P[level, level] += jump * jump
            S_old = S
            S = _step_covariance(kalman)
            if last >= 0 and k - start >= _NEAR:
                live = False
                since = min(_NEAR, last)
            elif k - start > 20 and abs(S - S_old) < (1e-7 if start == 0 else _SETTLED) * S:
                live = False
        elif since >= 0:
            copied(after[since], gain)
            S = their_variances[since]
            since = min(since + 1, last)

        # What holds at this sample
        copied(gain, gains[k])
        variances[k] = S
        if k <= SKIP or S != variances[k - 1]:
            log_var = math.log(S)
        if k >= SKIP:
            sum_log += log_var
    return gains, variances, sum_log


@njit_cached
def _filter_channels(channels, F, h, gains, variances):
    """Return what the filter does not foresee of each channel (m, n), over its standard
    deviation.
    """
    # Room for the state of every channel
    m, n = channels.shape
    s = h.size
    out = np.empty((m, n))
    x = np.zeros((s, m))
    x_new = np.zeros((s, m))
    nu = np.zeros(m)

    # F is a diagonal with a few couplings, and h is mostly zeros
    shows = np.zeros(s, np.int64)
    shown = 0
    to = np.zeros(s * s, np.int64)
    come = np.zeros(s * s, np.int64)
    weight = np.zeros(s * s)
    couplings = 0
    for i in range(s):
        if h[i] != 0.0:
            shows[shown] = i
            shown += 1
        for j in range(s):
            if i != j and F[i, j] != 0.0:
                to[couplings] = i
                come[couplings] = j
                weight[couplings] = F[i, j]
                couplings += 1

    # Each sample: what was not foreseen, over its standard deviation
    scale = 0.0
    for k in range(n):
        gain = gains[k]
        if k == 0 or variances[k] != variances[k - 1]:
            scale = 1.0 / math.sqrt(variances[k])
        if m == 1:
            # loops over a single channel cost more than what they do
            alone = channels[0, k]
            for q in range(shown):
                alone -= x[shows[q], 0]
            for i in range(s):
                x_new[i, 0] = gain[i] * alone + F[i, i] * x[i, 0]
            for q in range(couplings):
                x_new[to[q], 0] += weight[q] * x[come[q], 0]
            out[0, k] = alone * scale
            x, x_new = x_new, x
            continue
        # numbers that a loop over channels needs stand before it: only then is it compiled to
        # vectors
        for c in range(m):
            nu[c] = channels[c, k]
        for q in range(shown):
            i = shows[q]
            for c in range(m):
                nu[c] -= x[i, c]
        for i in range(s):
            own = F[i, i]
            g = gain[i]
            for c in range(m):
                x_new[i, c] = g * nu[c] + own * x[i, c]
        for q in range(couplings):
            i = to[q]
            j = come[q]
            w = weight[q]
            for c in range(m):
                x_new[i, c] += w * x[j, c]
        for c in range(m):
            out[c, k] = nu[c] * scale
        x, x_new = x_new, x
    return out


@njit_cached
def whiten(channels, model, jumps):
    """Return innovations over their standard deviation (m, n) of all channels, and the sum of log
    variances.

    `model` is a `NoiseModel`, `jumps` the `Jumps` of its load. The gain of one Kalman filter serves
    all channels.
    """
    kalman, level = _filter_of(model, jumps)
    # one more pole is one more sample on the way
    late = int(model.tau > 1e-3)
    gains, variances, log_var = _filter_gains(kalman, level, late, jumps, channels.shape[1])
    return _filter_channels(channels, kalman.F, kalman.h, gains, variances), log_var


@njit_cached
def _filter_of(model, jumps):
    """Return the Kalman filter of a model, and the state that jumps."""
    F, Q, P, h, r, level = _state_space(model, jumps)
    s = h.size
    to, come = np.nonzero(F)
    weight = np.empty(to.size)
    for q in range(to.size):
        weight[q] = F[to[q], come[q]]
    room = np.zeros(s), np.zeros(s), np.zeros((s, s))
    return _Filter(F, Q, P, h, r, to, come, weight, *room), level
