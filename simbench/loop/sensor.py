"""The measurement of PV: noise, and where a loop file asks for it a filter and a coarse
transmitter.
"""

from __future__ import annotations

from collections import namedtuple

Bare = namedtuple("Bare", "unused")
Transmitter = namedtuple("Transmitter", "follow step")
Freezing = namedtuple("Freezing", "follow step frozen")


def plain_start(pv0):
    """Return the state of a sensor without memory."""
    return (pv0,)


def plain_step(y, noise, state, p):
    """Return (measured PV, ) of this sample."""
    return (y + noise,)


def full_start(pv0):
    """Return the state (measured PV, filtered PV) at rest."""
    return pv0, pv0


def full_step(y, noise, state, p):
    """One sample of noise, first-order filter and rounding, in this order: the filter smooths the
    noise too.
    """
    z = state[1] + p.follow * (y + noise - state[1])
    if p.step > 0.0:
        return p.step * float(round(z / p.step)), z
    return z, z


def freezing_start(pv0):
    """Return (measured PV, filtered PV, sample) at rest."""
    return pv0, pv0, 0.0


def freezing_step(y, noise, state, p):
    """One sample of noise, filter and rounding; in frozen samples the reading stands."""
    z = state[1] + p.follow * (y + noise - state[1])
    if p.frozen[int(state[2])] > 0.0:
        return state[0], z, state[2] + 1.0
    if p.step > 0.0:
        x = p.step * float(round(z / p.step))
    else:
        x = z
    return x, z, state[2] + 1.0
