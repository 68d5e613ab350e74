"""P, PI and PID controllers: one sample each, and the same law as a transfer function for the
theory.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

# numba tells named tuples apart by their names: no two in the loop may share one
PI = namedtuple("PI", "Kc Ki lo hi")
P = namedtuple("P", "Kc op0 lo hi")
# kd = Td/(Td/N + Ts), fade = (Td/N)/(Td/N + Ts); `back` = 0 asks for clamping; `on` names what the
# schedule goes by
PID = namedtuple("PID", "Kc Ki lo hi b c kd fade back velocity pv0 on at factor")
SCHEDULED_ON = ("pv", "op", "sp")
OtherPI = namedtuple("OtherPI", "Kc Ki Kd follow lo hi moves idle")
NoGap = namedtuple("NoGap", "unused")
Gap = namedtuple("Gap", "half_band step")


def pi_start(op0, e0):
    """Return the state (OP, previous error) at rest; the first error counts as a change from
    `e0`.
    """
    return op0, e0


def pi_step(e, sp, state, p):
    """One sample of PI in velocity form: the backward-Euler integral, limited to lo..hi.

    Limiting OP itself is the anti-windup: the integral takes up whatever the limit cut off, so OP
    leaves the limit at once when the error turns. `p.Kc` carries the sign of the direction, `p.Ki`
    = Kc Ts/Ti.
    """
    u = state[0] + (p.Kc * (e - state[1]) + p.Ki * e)
    return min(max(u, p.lo), p.hi), e


def p_start(op0, e0):
    """Return the state of a P controller; it has no memory."""
    return op0, e0


def p_step(e, sp, state, p):
    """One sample of P: OP = op0 + Kc e, limited to lo..hi."""
    return min(max(p.op0 + p.Kc * e, p.lo), p.hi), e


def other_start(op0, e0):
    """Return (OP, (error, its filtered change, sample)) at rest."""
    return op0, (e0, 0.0, 0.0)


def other_step(e, sp, state, p):
    """One sample of PI in velocity form with a derivative of PV, and samples in which it does not
    run.

    `p.idle` marks these: OP stands, and nothing is remembered of them.
    """
    before, slope, k = state[1]
    if p.idle[int(k)] > 0.0:
        return state[0], (before, slope, k + 1.0)
    # the derivative is PV's: moves of the set point do not count
    now = slope + p.follow * (e - before - p.moves[int(k)] - slope)
    du = p.Kc * (e - before) + p.Ki * e + p.Kd * (now - slope)
    return min(max(state[0] + du, p.lo), p.hi), (e, now, k + 1.0)


def kicked(state, kick, p):
    """Return the state with OP offset by `kick` (%), within its limits."""
    return min(max(state[0] + kick, p.lo), p.hi), state[1]


def pid_start(op0, e0):
    """Return the state at rest: OP, what integrates (the integral, in velocity form OP before its
    limits), P, D, D's input.
    """
    return op0, op0, 0.0, 0.0, e0


def pid_step(e, sp, state, p):
    """One sample of PID: backward-Euler integral and filtered derivative, SP weighted in P and D,
    anti-windup.

    Astrom and Hagglund (2006), Advanced PID Control, chapters 3 and 13. Positional: OP = P + I + D;
    back-calculation feeds what the limit cuts off back to I, clamping holds I while the limit holds
    OP. Velocity: OP before its limits moves by the changes of P, I and D; clamping takes the
    limited OP for the next sample, back-calculation brings it there with Tt.
    """
    # Proportional and derivative terms, with their weights and the scheduled gain
    r = sp - p.pv0
    g = scheduled(sp - e if p.on == 0.0 else state[0] if p.on == 1.0 else sp, p.at, p.factor)
    now = g * p.Kc * (e - (1.0 - p.b) * r)
    f = e - (1.0 - p.c) * r
    d = p.fade * state[3] + g * p.Kc * p.kd * (f - state[4])

    # The velocity form adds changes to what was written last
    ahead = g * p.Ki * e
    if p.velocity > 0.0:
        v = state[1] + ((now - state[2]) + ahead + (d - state[3]))
        u = min(max(v, p.lo), p.hi)
        return u, (v + p.back * (u - v) if p.back > 0.0 else u), now, d, f

    # The positional form, with back-calculation where it is stated
    kept = state[1] + ahead
    v = now + kept + d
    if p.back > 0.0:
        u = min(max(v, p.lo), p.hi)
        return u, kept + p.back * (u - v), now, d, f

    # Else the integral stops at a limit
    if (v > p.hi and ahead > 0.0) or (v < p.lo and ahead < 0.0):
        kept = state[1]
    return min(max(now + kept + d, p.lo), p.hi), kept, now, d, f


def pid_kicked(state, kick, p):
    """Return the state with OP offset by `kick` (%), which the integral keeps."""
    u = min(max(state[0] + kick, p.lo), p.hi)
    return u, state[1] + (u - state[0]), state[2], state[3], state[4]


def scheduled(x, at, factor):
    """Return the factor on Kc at `x`: straight between the points, the end's beyond them."""
    i = 0
    while i < at.shape[0] and at[i] < x:
        i += 1
    if i == 0:
        return factor[0]
    if i == at.shape[0]:
        return factor[i - 1]
    return factor[i - 1] + (factor[i] - factor[i - 1]) * ((x - at[i - 1]) / (at[i] - at[i - 1]))


def pid_numbers(c, Kc, Ti, Ts, pv0, lo, hi):
    """Return the numbers of a loop file's PID for `pid_step`; `Kc` (signed) and `Ti` as effects
    left them.
    """
    # The derivative filter and the tracking time
    Td = c.Td or 0.0
    lag = Td / derivative_filter(c)
    back = 0.0
    if c.anti_windup == "back-calculation":
        back = min(Ts / (c.Tt or (np.sqrt(Ti * Td) if Td > 0.0 else Ti)), 1.0)

    # The schedule, the weights and the form
    points = np.array(c.schedule or [[0.0, 1.0]], dtype=float).T.copy()
    b = 1.0 if c.b is None else c.b
    weight = 0.0 if c.c is None else c.c
    velocity = float(c.form == "velocity")
    on = float(SCHEDULED_ON.index(c.schedule_on or "pv"))

    # In the order of the step's fields
    numbers = (
        Kc,
        Kc * Ts / Ti,
        lo,
        hi,
        b,
        weight,
        Td / (lag + Ts),
        lag / (lag + Ts),
        float(back),
        velocity,
        pv0,
        on,
    )
    return PID(*numbers, points[0], points[1])


def derivative_filter(c):
    """Return N of a loop file's PID: its derivative is filtered with Td/N."""
    return 10.0 if c.N is None else c.N


def plugin_kicked(state, kick, p):
    """Return the state of a plug-in with OP, its first entry, offset by `kick` (%), within its
    limits.
    """
    return (min(max(state[0] + kick, p.lo), p.hi), *state[1:])


def plain_error(e, p):
    """Return the error as it is."""
    return e


def dead_error(e, p):
    """Return the error, or 0 inside the controller's dead-band of half width `half_band`."""
    return 0.0 if abs(e) <= p.half_band else e


def plain_output(u, p):
    """Return OP as it is."""
    return u


def coarse_output(u, p):
    """Return OP rounded to the lattice of the output card."""
    if p.step > 0.0:
        return p.step * float(round(u / p.step))
    return u
