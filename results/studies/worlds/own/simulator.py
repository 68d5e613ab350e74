"""Simulate a loop of the blind test with sub-steps in every sample, valves with velocity, and
several forms of PI controllers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from simbench.detectors.compiled import njit_cached

SUBSTEPS = 12
_IDEAL, PLAY, KARNOPP, STRIBECK, HE = range(5)
POSITION, VELOCITY = range(2)
BACKWARD, FORWARD, TRAPEZOID = range(3)


class Physics(NamedTuple):
    """Every number of one run; the defaults describe a plain loop, so that a fault at zero strength
    is the plain loop.
    """

    # plant: K in PV units per % (integrating: per % and s), times in s
    integrating: float = 0.0
    K: float = 1.0
    T: float = 10.0
    Td: float = 2.0
    extra_lag: float = 0.0
    level_gain: float = 0.0  # relative change of K per PV unit
    inverse: float = 0.0  # s; PV starts in the wrong direction
    # controller: Kc in % per PV unit, Ti in s (0 = P only), OP in %
    sign: float = 1.0
    Kc: float = 1.0
    Ti: float = 10.0
    bias: float = 50.0
    form: float = POSITION
    integral: float = BACKWARD
    lo: float = 0.0
    hi: float = 100.0
    error_deadband: float = 0.0
    error_gap_is_smooth: float = 0.0  # 1: the error outside the band counts from the band's edge
    op_step: float = 0.0
    derivative: float = 0.0  # s
    sp_weight: float = 1.0  # share of SP that the proportional part sees
    # valve, % of travel
    friction: float = _IDEAL
    fs: float = 0.0  # break-away
    fc: float = 0.0  # sliding friction
    slew: float = 0.0  # %/s the stem can move at most; 0 = any
    speed: float = 8.0  # natural frequency x Ts of the moving parts
    deadzone: float = 0.0
    deadzone_centre: float = 50.0
    R: float = 1.0
    valve_lag: float = 0.0
    play: float = 0.0  # a known dead-band in front of everything else
    # sensor
    pv0: float = 50.0
    sensor_lag: float = 0.0
    pv_step: float = 0.0
    # time
    Ts: float = 1.0
    op0: float = 50.0


@njit_cached
def _play(u, v, band):
    return max(u - 0.5 * band, min(u + 0.5 * band, v))


@njit_cached
def _characteristic(x, R):
    return x if R == 1.0 else 100.0 * (R ** (x / 100.0) - 1.0) / (R - 1.0)


@njit_cached
def _stem(u, x, w, p, h):
    """One sub-step of stem position x (%) and velocity w (%/s) under OP u: spring, mass, dry
    friction in units of travel.
    """
    wn = p.speed / p.Ts
    pull = u - x
    slow = 1e-3 * p.speed / p.Ts
    if abs(w) < slow and abs(pull) <= p.fs:
        return x, 0.0
    if w != 0.0:
        way = 1.0 if w > 0 else -1.0
    else:
        way = 1.0 if pull > 0 else -1.0
    sliding = p.fc
    if p.friction == STRIBECK:
        sliding += (p.fs - p.fc) * math.exp(-((w / (40.0 * slow)) ** 2))
    new = (w + h * wn * wn * (pull - way * sliding)) / (1.0 + 2.4 * wn * h)
    # the velocity would change sign: the stem has come to rest within the step
    if new * way <= 0.0:
        return x, 0.0
    return x + h * new, new


class Inputs(NamedTuple):
    """Everything that reaches one run from outside, each of shape (n,)."""

    sp: np.ndarray  # PV units
    noise: np.ndarray  # PV units
    load: np.ndarray  # %
    sensor: np.ndarray  # added to the measurement, PV units
    skip: np.ndarray  # 1: the controller misses its turn
    hold: np.ndarray  # 1: the transmitter repeats its last value
    asleep: np.ndarray  # 1: the valve does not answer
    op_add: np.ndarray  # %
    valve_add: np.ndarray  # %
    gain: np.ndarray  # factor on K
    hand: np.ndarray  # % an operator adds to the OP at which he took over, NaN in automatic


@njit_cached
def run(p, inputs, op, pv, true, mv):
    """Run the loop over all samples of `inputs`; fills op, pv (as the controller saw it), true
    (noise-free PV) and mv.
    """
    sp, noise, load, sensor, skip, hold, asleep, op_add, valve_add, gain, hand = inputs
    n = sp.size
    h = p.Ts / SUBSTEPS
    delay = round(p.Td / h) + 1
    line = np.full(delay, p.op0)
    place = 0
    keep = math.exp(-h / p.T) if p.integrating == 0.0 else 1.0
    keep_extra = math.exp(-h / p.extra_lag) if p.extra_lag > 0 else 0.0
    keep_inverse = math.exp(-h / (0.5 * p.inverse)) if p.inverse > 0 else 0.0
    keep_sensor = math.exp(-h / p.sensor_lag) if p.sensor_lag > 0 else 0.0
    keep_noise = math.exp(-p.Ts / p.sensor_lag) if p.sensor_lag > 0 else 0.0
    keep_valve = math.exp(-h / p.valve_lag) if p.valve_lag > 0 else 0.0
    x = y_extra = y_inverse = y_sensor = slope = 0.0
    smoothed = 0.0
    u = before = taken = p.bias
    stem, velocity, position, backlash = u, 0.0, p.op0, u
    integral = derivative = e_before = p_before = d_before = y_before = y_held = 0.0
    first = True
    for k in range(n):
        out = y_inverse if p.inverse > 0 else y_extra
        true[k] = p.pv0 + out
        smoothed = keep_noise * smoothed + (1.0 - keep_noise) * noise[k]
        y = p.pv0 + (y_sensor if p.sensor_lag > 0 else out) + sensor[k] + smoothed
        if p.pv_step > 0:
            y = p.pv_step * math.floor(y / p.pv_step + 0.5)
        if hold[k] > 0 and not first:
            y = y_held
        y_held = y
        pv[k] = y
        # controller
        e = sp[k] - y
        if p.error_deadband > 0:
            half = 0.5 * p.error_deadband
            if abs(e) <= half:
                e = 0.0
            elif p.error_gap_is_smooth > 0:
                e -= half if e > 0 else -half
        proportional = e - (1.0 - p.sp_weight) * (sp[k] - sp[0])
        if first:
            e_before, p_before, y_before = e, proportional, y
        if p.derivative > 0:  # on PV, filtered over a tenth of the derivative time
            share = p.Ts / (p.Ts + 0.1 * p.derivative)
            derivative += share * (-p.derivative * (y - y_before) / p.Ts - derivative)
        if skip[k] == 0.0:
            if p.integral == BACKWARD:
                push = e
            else:
                push = e_before if p.integral == FORWARD else 0.5 * (e + e_before)
            if p.Ti == 0.0:
                u = p.bias + p.sign * p.Kc * (proportional + derivative)
            elif p.form == VELOCITY:
                u += (
                    p.sign
                    * p.Kc
                    * (proportional - p_before + p.Ts / p.Ti * push + derivative - d_before)
                )
            else:
                integral += p.Ts / p.Ti * push
                u = p.bias + p.sign * p.Kc * (proportional + integral + derivative)
            e_before, p_before, d_before, y_before = e, proportional, derivative, y
            limited = min(max(u, p.lo), p.hi)
            # anti-windup: the integral gives back what was cut
            if limited != u and p.form == POSITION and p.Ti > 0:
                integral += p.sign * (limited - u) / p.Kc
            u = limited
        if not math.isnan(hand[k]):
            if k == 0 or math.isnan(hand[k - 1]):
                taken = before
            u = min(max(taken + hand[k], p.lo), p.hi)
            # no bump on the way back
            integral = p.sign * (u - p.bias) / p.Kc - proportional
        before = u
        first = False
        sent = u + op_add[k]
        if p.op_step > 0:
            sent = p.op_step * math.floor(sent / p.op_step + 0.5)
        sent = min(max(sent, p.lo), p.hi)
        op[k] = sent
        # valve and plant, SUBSTEPS times
        if p.friction == HE:  # a digital positioner model: one decision per sample
            pull = sent - stem
            if abs(pull) > p.fs:
                stem = sent - (p.fc if pull > 0 else -p.fc)
        last = load[max(k - 1, 0)]
        for j in range(SUBSTEPS):
            backlash = _play(sent, backlash, p.play)
            goal = backlash
            if p.deadzone > 0:
                away = goal - p.deadzone_centre
                size = max(abs(away) - 0.5 * p.deadzone, 0.0)
                goal = p.deadzone_centre + (size if away > 0 else -size)
            if asleep[k] > 0:
                goal = stem
            if p.friction == _IDEAL:
                most = p.slew * h if p.slew > 0 else 200.0
                stem += min(max(goal - stem, -most), most)
            elif p.friction == PLAY:
                stem = _play(goal, stem, 2.0 * p.fc)
            elif p.friction != HE:
                stem, velocity = _stem(goal, stem, velocity, p, h)
            wanted = min(max(_characteristic(stem + valve_add[k], p.R), 0.0), 100.0)
            position = keep_valve * position + (1.0 - keep_valve) * wanted
            line[place] = position + last + (load[k] - last) * (j + 1) / SUBSTEPS
            place = (place + 1) % delay
            flow = line[place] - p.op0
            strength = p.K * gain[k] * max(1.0 + p.level_gain * x, 0.2)
            if p.integrating > 0:
                slope = strength * flow
                x += h * slope
            else:
                slope = (strength * flow - x) / p.T
                x = keep * x + (1.0 - keep) * strength * flow
            y_extra = keep_extra * y_extra + (1.0 - keep_extra) * x
            y_inverse = keep_inverse * y_inverse + (1.0 - keep_inverse) * (
                y_extra - p.inverse * slope
            )
            now = y_inverse if p.inverse > 0 else y_extra
            y_sensor = keep_sensor * y_sensor + (1.0 - keep_sensor) * now
        mv[k] = position
