"""Controllers as products sell them: each one a step function with its form, anti-windup and
integral rule.
"""

from __future__ import annotations

from typing import NamedTuple

PROPORTIONAL, VELOCITY, CONDITIONAL, TRACKING, CLAMPED = range(5)

# integral rule: shares of the newest and the previous error in one increment Kc Ts/Ti e
RULES = {"forward": (0.0, 1.0), "backward": (1.0, 0.0), "trapezoidal": (0.5, 0.5)}


class _Product(NamedTuple):
    """One controller block: its step function, its integral rule, what it is."""

    law: int
    rule: str
    says: str


PRODUCTS = {
    "bias_p": _Product(PROPORTIONAL, "backward", "P with a manual bias, positional"),
    "velocity_backward": _Product(
        VELOCITY, "backward", "increments added to the limited OP, newest error"
    ),
    "velocity_forward": _Product(
        VELOCITY, "forward", "increments added to the limited OP, previous error"
    ),
    "velocity_trapezoidal": _Product(
        VELOCITY, "trapezoidal", "increments added to the limited OP, mean error"
    ),
    "conditional_backward": _Product(
        CONDITIONAL, "backward", "positional; no integration further into a limit"
    ),
    "conditional_trapezoidal": _Product(
        CONDITIONAL, "trapezoidal", "positional; no integration further into a limit"
    ),
    "tracking_forward": _Product(
        TRACKING, "forward", "positional; integral pulled back by the excess (back-calculation)"
    ),
    "tracking_backward": _Product(
        TRACKING, "backward", "positional; integral pulled back by the excess (back-calculation)"
    ),
    "clamped_forward": _Product(
        CLAMPED, "forward", "positional; the integral itself held within the limits"
    ),
    "clamped_backward": _Product(
        CLAMPED, "backward", "positional; the integral itself held within the limits"
    ),
    "clamped_trapezoidal": _Product(
        CLAMPED, "trapezoidal", "positional; the integral itself held within the limits"
    ),
}
STATES = 3  # integral or bias, previous error, OP before anything is added to it


def clip(u, lo, hi):
    """Limit u to lo..hi."""
    return min(max(u, lo), hi)


# `law` in what follows is the named tuple `Law` of loop.py


def proportional(e, state, law):
    """u = bias + Kc e."""
    state[1] = e
    state[2] = clip(state[0] + law.Kc * e, law.lo, law.hi)
    return state[2]


def increment(e, state, law):
    """Return ki (now e + before e_prev), what one scan adds to the integral."""
    return law.ki * (law.now * e + law.before * state[1])


def velocity(e, state, law):
    """u = limited last u + Kc (e - e_prev) + ki (now e + before e_prev): the limit itself is the
    anti-windup.
    """
    u = state[2] + law.Kc * (e - state[1]) + increment(e, state, law)
    state[1] = e
    state[2] = clip(u, law.lo, law.hi)
    return state[2]


def conditional(e, state, law):
    """u = Kc e + I; the increment of I is dropped while u is beyond a limit and the increment would
    drive it further.
    """
    more = increment(e, state, law)
    u = law.Kc * e + state[0] + more
    if (u > law.hi and more > 0.0) or (u < law.lo and more < 0.0):
        u -= more
    else:
        state[0] += more
    state[1] = e
    state[2] = clip(u, law.lo, law.hi)
    return state[2]


def tracking(e, state, law):
    """u = Kc e + I; I is corrected by `back` (Ts/Tt, at most 1) times what the limit took away."""
    state[0] += increment(e, state, law)
    raw = law.Kc * e + state[0]
    state[1] = e
    state[2] = clip(raw, law.lo, law.hi)
    state[0] += law.back * (state[2] - raw)
    return state[2]


def clamped(e, state, law):
    """u = Kc e + I with I itself limited: at a limit the proportional part can still take OP
    back.
    """
    state[0] = clip(state[0] + increment(e, state, law), law.lo, law.hi)
    state[1] = e
    state[2] = clip(law.Kc * e + state[0], law.lo, law.hi)
    return state[2]


def control(e, state, law):
    """Return OP of one scan of the product's law; e has the sign of the action already."""
    if law.product == PROPORTIONAL:
        return proportional(e, state, law)
    if law.product == VELOCITY:
        return velocity(e, state, law)
    if law.product == CONDITIONAL:
        return conditional(e, state, law)
    if law.product == TRACKING:
        return tracking(e, state, law)
    return clamped(e, state, law)


def follow(law, e, state, Kc, u):
    """Take over `u` from a hand without a bump: what the law remembers fits to it."""
    state[1] = e
    state[2] = u
    if law != PROPORTIONAL:
        state[0] = u - Kc * e
