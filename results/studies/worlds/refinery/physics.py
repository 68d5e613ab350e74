"""The closed loop in continuous time: plant, valve, load and transmitter on a fine grid, the
controller once per scan.

Every first-order element is advanced by its exact solution for an input held (or taken as its mean)
over the fine step of Ts/24; dead time is a delay line read between two cells. Within a scan:
measure, control, then move for one Ts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from results.studies.worlds.refinery.controller import OUT, at_rest, execute, take, watch
from results.studies.worlds.refinery.valves import play, scan, stroke

SUBSTEPS = 24


class Plant(NamedTuple):
    """Numbers of the plant: K in PV units per % (integrating: per % and s), times in s; both small
    lags may be 0.
    """

    integrating: bool
    K: float
    T: float  # foptd; unused when integrating
    Td: float
    lag1: float = 0.0
    lag2: float = 0.0
    extra_lag: float = 0.0
    slower: float = 1.0  # foreign: T when PV falls / T when PV rises
    # foreign: gain of the opposite fast path / K (integrating: / (K swell_time))
    swell: float = 0.0
    swell_time: float = 1.0
    # foreign: share of the output that comes back through the feed-effluent exchanger
    recycle: float = 0.0
    recycle_delay: float = 0.0
    bend: float = 0.0  # change of the gain per % of travel, of the gain


class Sensor(NamedTuple):
    """Numbers of the transmitter: PV units and s."""

    lag: float = 0.0
    count: float = 0.0  # the converter's lattice, finer than the noise
    count_offset: float = 0.0
    quantum: float = 0.0  # the effect quantisation in the loop: lattice through 0
    flow_noise: float = 0.0  # 1 = noise proportional to flow, 0 = constant
    float_play: float = 0.0  # foreign: travel lost between level and displacer
    clip_lo: float = -1e18
    clip_hi: float = 1e18


class Signals(NamedTuple):
    """What drives the loop from outside, shape (N,) except load (N * SUBSTEPS,): PV units, load in
    %.
    """

    sp: np.ndarray
    load: np.ndarray
    noise: np.ndarray
    error: np.ndarray  # slow error of the measurement
    spikes: np.ndarray
    held: np.ndarray  # bool: the reading does not move
    manual: np.ndarray  # bool: OP does not move
    hand: np.ndarray  # what an operator's test adds to the OP at which he took over, %; NaN without
    between: np.ndarray  # bool: a row of a log faster than the scan
    missed: np.ndarray  # int: 1 where the controller does not run, 2 where it still tracks PV
    shift: np.ndarray  # error of the reading behind its filter


def _delayed(line, head, steps):
    """Read the delay line `steps` (may be a fraction) cells before the newest one."""
    whole = math.floor(steps)
    part = steps - whole
    size = line.size
    return (1.0 - part) * line[(head - whole) % size] + part * line[(head - whole - 1) % size]


def _lagged(state, old, new, keep):
    """First-order lag over one fine step with the input's mean; `keep` = exp(-h/tau), 0 passes the
    input.
    """
    if keep == 0.0:
        return new
    middle = 0.5 * (old + new)
    return middle + (state - middle) * keep


def _keep(h, tau):
    return math.exp(-h / tau) if tau > 0.0 else 0.0


def _digitise(y, s):
    """Range, converter lattice, coarse lattice."""
    y = min(max(y, s.clip_lo), s.clip_hi)
    if s.count > 0.0:
        y = s.count_offset + round((y - s.count_offset) / s.count) * s.count
    if s.quantum > 0.0:
        y = round(y / s.quantum) * s.quantum
    return y


def _react(x, w, back, h, p, keeps):
    """One fine step of the main plant from delayed input `w`; x[0] main state, x[1] swell; `back`
    the recycled output.
    """
    if p.bend != 0.0:
        # half, at a distance from the balance, of what the slope there has changed by
        w *= max(1.0 + 0.5 * p.bend * w, 0.3)
    if p.integrating:
        x[0] += p.K * h * w
        if p.swell > 0.0:
            goal = -p.swell * p.K * p.swell_time * w
            x[1] = goal + (x[1] - goal) * keeps[2]
        return
    goal = p.K * w
    if p.recycle > 0.0:
        goal = (1.0 - p.recycle) * goal + p.recycle * back
    goal *= 1.0 + p.swell
    x[0] = goal + (x[0] - goal) * (keeps[0] if goal >= x[0] else keeps[1])
    if p.swell > 0.0:
        goal = -p.swell * p.K * w
        x[1] = goal + (x[1] - goal) * keeps[2]


def _keeps(h, p, sensor_lag, valve_lag):
    """exp(-h/tau) of every first-order element: T rising, T falling, swell, three lags,
    transmitter, valve.
    """
    taus = (p.T, p.T * p.slower, p.swell_time, p.lag1, p.lag2, p.extra_lag, sensor_lag, valve_lag)
    keeps = np.empty(8)
    for i in range(8):
        keeps[i] = _keep(h, taus[i])
    return keeps


def close_loop(p, c, v, s, x, m0, pv0, stem):
    """Run the loop over all scans of `x` (Signals) about the balance (MV `m0` %, PV `pv0`); `stem`
    is the valve's state.

    Returns PV as the controller sees it, OP, MV at the end of each scan, PV and MV averaged over
    the scan before, and PV as it is.
    """
    n, h = x.sp.size, c.Ts / SUBSTEPS
    pv, op, mv, pv_mean, mv_mean, true = (
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
    )
    line, back = np.zeros(int(p.Td / h) + 3), np.zeros(int(p.recycle_delay / h) + 3)
    state, keeps = at_rest(), _keeps(h, p, s.lag, v.lag)
    y, chain = np.zeros(2), np.full(4, x.sp[0] - pv0)  # chain: plant, then three lags
    y[0] = shown = chain[0]
    back[:] = y[0]
    filtered = reading = average = x.sp[0]
    position = valve_average = m0
    cell = last = 0
    taken = m0
    for k in range(n):
        if not x.held[k]:
            reading = _digitise(filtered + x.shift[k], s) + x.spikes[k]
            average += x.spikes[k] + x.shift[k]
        else:
            average = reading
        pv[k], pv_mean[k], mv_mean[k] = reading, average, valve_average
        true[k] = pv0 + chain[3]
        if x.between[k] or (x.missed[k] and k):
            op[k] = op[k - 1] if k else m0
            if x.missed[k] == 2:
                watch(x.sp[k], reading, state, c)
        elif np.isnan(x.hand[k]):
            op[k] = execute(x.sp[k], reading, x.manual[k], state, c)
        else:
            if k == 0 or np.isnan(x.hand[k - 1]):
                taken = state[OUT]
            op[k] = take(x.sp[k], reading, taken + x.hand[k], state, c)
        drive = scan(op[k], stem, v)
        noise = x.noise[min(k + 1, n - 1)]
        average = valve_average = 0.0
        for j in range(SUBSTEPS):
            position = stroke(drive, h, keeps[7], stem, v)
            cell, last = (cell + 1) % line.size, (last + 1) % back.size
            line[cell] = position + x.load[k * SUBSTEPS + j] - m0
            _react(
                y,
                _delayed(line, cell, p.Td / h),
                _delayed(back, last, p.recycle_delay / h),
                h,
                p,
                keeps,
            )
            back[last] = y[0]
            old, new = chain[0], y[0] + y[1]
            chain[0] = new
            for i in range(1, 4):
                before = chain[i]
                chain[i] = _lagged(before, old, new, keeps[2 + i])
                old, new = before, chain[i]
            if s.float_play > 0.0:
                old, shown = shown, play(new, shown, s.float_play)
                new = shown
            wild = x.error[k] + noise * (1.0 + s.flow_noise * (max(position / m0, 0.1) - 1.0))
            filtered = _lagged(filtered, pv0 + old + wild, pv0 + new + wild, keeps[6])
            average += _digitise(filtered, s) / SUBSTEPS
            valve_average += position / SUBSTEPS
        mv[k] = position
    return pv, op, mv, pv_mean, mv_mean, true
