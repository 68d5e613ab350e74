"""The compiled loop: PV is measured, OP computed, the valve moves, the plant takes one exact
step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from results.studies.worlds.mill.controller import STATES as CONTROLLER_STATES
from results.studies.worlds.mill.controller import clip, control, follow
from results.studies.worlds.mill.plant import Discrete
from results.studies.worlds.mill.valve import DEADZONE, STATES, deadzone, friction, installed, play
from simbench.detectors.compiled import compiled


class Law(NamedTuple):
    """The controller and what is between it and the valve."""

    product: int  # law of `controller`
    sign: float  # +1 reverse, -1 direct
    Kc: float
    ki: float  # Kc times scan time over Ti
    now: float
    before: float
    back: float  # scan time over tracking time
    lo: float
    hi: float
    deadband: float  # of the error, full width
    step: float  # OP lattice, an effect
    resolution: float  # OP lattice of the output card
    hand: float  # % per PV unit that an operator adds in manual


class Element(NamedTuple):
    """The valve."""

    band: float  # backlash, % of travel
    kind: int  # friction or dead-zone
    first: float  # fs, or D
    second: float  # fd, or c
    R: float  # installed characteristic
    keep: float  # exp(-Ts/tau) of the lag
    rate: float  # stroke, % per sample
    stop_lo: float  # mechanical stops, %
    stop_hi: float
    ring: np.ndarray  # shape (2, 3): a positioner's two states one sample on; all 0 = none


class Sensor(NamedTuple):
    """What lies between the plant and the controller."""

    keep: float  # exp(-Ts/tau) of the filter
    step: float  # lattice through 0
    count: float  # the transmitter's fine lattice
    count_at: float  # a point of that lattice
    flow: float  # growth of the noise with MV, per %
    width: float  # curvature of a titration, PV units; 0 = straight
    shape: float  # +1 flattens away from the set point, -1 steepens


class Signals(NamedTuple):
    """One row a sample: everything that reaches the loop from outside."""

    sp: np.ndarray
    load: np.ndarray  # at the plant's input, %
    noise: np.ndarray  # PV units
    wander: np.ndarray  # error of the measurement, PV units
    upset: np.ndarray  # what strikes PV itself, after the plant
    spikes: np.ndarray
    forward: np.ndarray  # feedforward added to OP, %
    # int8: 0 automatic, 1 manual, 2 manual and the operator corrects, 3 scan missed
    mode: np.ndarray
    held: np.ndarray  # int8: 1 = the measurement repeats its last value
    hand: np.ndarray  # OP as an operator's test adds to where he took over, %; NaN without


class Place(NamedTuple):
    """The operating point, and what returns of the plant's flow."""

    pv0: float
    mv0: float  # MV at balance, %
    op0: float  # OP at balance, %
    share: float  # of the flow that comes back
    back: int  # after so many samples


def _titrate(y, width, shape):
    if width <= 0.0:
        return y
    if shape > 0.0:
        return width * np.arcsinh(y / width)
    return width * np.sinh(min(max(y / width, -6.0), 6.0))


def _valve(u, memory, ring_state, element):
    """One sample of the final control element; memory: play, lag, stroke, then the friction model's
    own.
    """
    memory[0] = play(u, memory[0], element.band)
    v = memory[0]
    if element.kind == DEADZONE:
        v = deadzone(v, element.first, element.second)
    else:
        v = friction(element.kind, v, memory[3:], element.first, element.second)
    v = installed(v, element.R)
    memory[1] = element.keep * memory[1] + (1.0 - element.keep) * v
    v = memory[1]
    ring = element.ring
    if ring[0, 2] != 0.0:
        position = ring[0, 0] * ring_state[0] + ring[0, 1] * ring_state[1] + ring[0, 2] * v
        ring_state[1] = ring[1, 0] * ring_state[0] + ring[1, 1] * ring_state[1] + ring[1, 2] * v
        ring_state[0] = position
        v = position
    if abs(v - memory[2]) > element.rate:
        v = memory[2] + (element.rate if v > memory[2] else -element.rate)
    v = clip(clip(v, element.stop_lo, element.stop_hi), 0.0, 100.0)
    memory[2] = v
    return v


def _run(plant, law, element, sensor, s, place):
    """Return PV as the controller saw it, OP, MV and PV as it is, each (N,)."""
    A, old, new, c, delay = plant
    n, m = len(s.sp), len(c)
    pv, op, mv, w, true = np.empty(n), np.empty(n), np.empty(n), np.zeros(n), np.empty(n)
    x, following = np.zeros(m), np.zeros(m)
    memory, ring_state, state = np.zeros(3 + STATES), np.zeros(2), np.zeros(CONTROLLER_STATES)
    memory[0], memory[3], memory[5] = place.op0, place.op0, place.op0
    memory[1], memory[2], ring_state[0] = place.mv0, place.mv0, place.mv0
    state[0], state[2] = place.op0, place.op0
    filtered, before_pv, before_mv, u, taken = place.pv0, place.pv0, place.mv0, place.op0, place.op0
    for k in range(n):
        y = 0.0
        for i in range(m):
            y += c[i] * x[i]
        true[k] = y = place.pv0 + _titrate(y, sensor.width, sensor.shape) + s.upset[k]
        measured = y + s.wander[k] + s.noise[k] * (1.0 + sensor.flow * (before_mv - place.mv0))
        filtered = sensor.keep * filtered + (1.0 - sensor.keep) * measured
        now = filtered + s.spikes[k]
        if sensor.step > 0.0:
            now = np.round(now / sensor.step) * sensor.step
        if sensor.count > 0.0:
            now = sensor.count_at + np.round((now - sensor.count_at) / sensor.count) * sensor.count
        if s.held[k] == 1:
            now = before_pv
        pv[k] = now
        before_pv = now

        e = law.sign * (s.sp[k] - now)
        if abs(e) <= law.deadband / 2.0:
            e = 0.0
        if not np.isnan(s.hand[k]):
            if k == 0 or np.isnan(s.hand[k - 1]):
                taken = state[2]
            u = clip(taken + s.hand[k], law.lo, law.hi)
            follow(law.product, e, state, law.Kc, u)
        elif s.mode[k] == 0:
            u = control(e, state, law)
        elif s.mode[k] < 3:
            u = clip(state[2] + (law.hand * e if s.mode[k] == 2 else 0.0), law.lo, law.hi)
            follow(law.product, e, state, law.Kc, u)
        out = u + s.forward[k]
        if law.step > 0.0:
            out = np.round(out / law.step) * law.step
        if law.resolution > 0.0:
            out = np.round(out / law.resolution) * law.resolution
        op[k] = clip(out, law.lo, law.hi)

        mv[k] = _valve(op[k], memory, ring_state, element)
        before_mv = mv[k]

        flow = mv[k] - place.mv0 + s.load[k]
        returned = w[k - place.back] if place.back > 0 and k >= place.back else 0.0
        w[k] = (1.0 - place.share) * flow + place.share * returned
        late = w[k - delay] if k >= delay else 0.0
        later = w[k - delay - 1] if k >= delay + 1 else 0.0
        for i in range(m):
            total = old[i] * later + new[i] * late
            for j in range(m):
                total += A[i, j] * x[j]
            following[i] = total
        x[:] = following
    return pv, op, mv, true


def run(
    plant: Discrete, law: Law, element: Element, sensor: Sensor, signals: Signals, place: Place
) -> dict[str, np.ndarray]:
    """Run the loop over all rows of the signals, from rest at the operating point."""
    pv, op, mv, true = compiled(_run)(plant, law, element, sensor, signals, place)
    return {"pv": pv, "op": op, "mv": mv, "true": true}
