"""The steps of controller and sensor that a law puts in place of the loop's own: one sample each,
and their states at rest.
"""

from __future__ import annotations

from collections import namedtuple

# numba tells named tuples apart by their names: no two in the loop may share one
LawPI = namedtuple(
    "LawPI", "Kc Ki lo hi base square side schedule middle Kd follow down up ignored moves idle"
)
LawSensor = namedtuple("LawSensor", "follow step lo hi idle")


def controller_start(op0, e0):
    """Return (OP, (error as it counts, its filtered change, sample)) at rest."""
    return op0, (e0, 0.0, 0.0)


def controller_step(e, sp, state, p):
    """One sample of PI in velocity form, its error bent, its gain scheduled by OP, with derivative,
    rate limits and idle scans.

    `p.idle` marks the samples in which the controller does not run: OP stands, and nothing is
    remembered of them.
    """
    before, slope, k = state[1]
    if p.idle[int(k)] > 0.0:
        return state[0], (before, slope, k + 1.0)
    counts = e * (p.base + p.square * abs(e)) + p.side * abs(e)
    # the derivative is PV's, and the gain may answer the set point less
    now = slope + p.follow * (counts - before - p.moves[int(k)] - slope)
    du = p.Kc * (counts - before - p.ignored * p.moves[int(k)]) + p.Ki * counts
    du = du * max(1.0 + p.schedule * (state[0] - p.middle), 0.05)
    du = min(max(du + p.Kd * (now - slope), -p.down), p.up)
    return min(max(state[0] + du, p.lo), p.hi), (counts, now, k + 1.0)


def sensor_start(pv0):
    """Return (measured PV, filtered PV, sample) at rest."""
    return pv0, pv0, 0.0


def sensor_step(y, noise, state, p):
    """One sample of noise, filter, rounding and range; in idle samples the reading stands."""
    z = state[1] + p.follow * (y + noise - state[1])
    if p.idle[int(state[2])] > 0.0:
        return state[0], z, state[2] + 1.0
    x = p.step * float(round(z / p.step)) if p.step > 0.0 else z
    return min(max(x, p.lo), p.hi), z, state[2] + 1.0
