"""The measurement of PV: noise, and where a loop file asks for it a filter and a coarse
transmitter.
"""

from __future__ import annotations

from collections import namedtuple

Bare = namedtuple("Bare", "unused")
Transmitter = namedtuple("Transmitter", "follow step")


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
