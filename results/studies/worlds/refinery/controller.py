"""The DCS controller, once per scan: P, PI and PID in velocity and positional form, three integral
rules, four anti-windups.

The foreign kinds of this block live here too, since they are other laws: error squared, derivative
action, a ramp on closing, manual episodes. Textbook: Astrom and Hagglund, Advanced PID Control
(2006), ch. 3 and 13.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

FORMS = ("positional", "velocity")
RULES = ("backward", "forward", "trapezoidal")
WINDUPS = ("conditional", "back_calculation", "clamped")
# the integral is a lag of what went to the valve (Shinskey 1996, external reset)
RESET = "external_reset"
# places in the state array: integral, last error, last OP before rounding, last PV, filtered
# derivative, first scan done, first set point, last set point
_INTEGRAL, ERROR, OUT, PV, _DERIVATIVE, _STARTED, _SP0, _SP = range(8)


class Controller(NamedTuple):
    """Numbers of the controller: Kc in % per PV unit (signed by the action), times in s, OP in
    %.
    """

    Kc: float
    Ti: float  # 0 = P
    Ts: float
    bias: float
    velocity: bool = False
    rule: int = 0
    windup: int = 0
    lo: float = 0.0
    hi: float = 100.0
    op_step: float = 0.0  # the converter's resolution
    quantum: float = 0.0  # the effect op_quantisation
    dead_width: float = 0.0  # PV units, full width
    square_share: float = 0.0  # foreign: share of the error-squared law
    square_scale: float = 1.0  # PV units: error at which the squared law has the gain Kc
    Td: float = 0.0  # derivative time; foreign where the baseline states none
    b: float = 1.0  # weight of SP in the proportional part
    c: float = 0.0  # and in the derivative
    close_rate: float = 0.0  # foreign: fastest closing, % per s; 0 = not limited


def _shaped(e, c):
    """The error that the law sees: dead-band, then the error-squared mixture."""
    if abs(e) <= 0.5 * c.dead_width:
        return 0.0
    if c.square_share > 0.0:
        return e * (1.0 - c.square_share + c.square_share * abs(e) / c.square_scale)
    return e


def _area(e, last, c):
    """Integral of the error over one scan by the chosen rule, times Kc/Ti, in %."""
    if c.Ti <= 0.0:
        return 0.0
    mean = e if c.rule == 0 else (last if c.rule == 1 else 0.5 * (e + last))
    return c.Kc * c.Ts / c.Ti * mean


def positional(proportional, step, lo, hi, state, c):
    """bias + P + I with the anti-windup on I; returns the limited output (%)."""
    if c.windup == 3:
        out = min(max(c.bias + proportional + state[_INTEGRAL], lo), hi)
        state[_INTEGRAL] += min(c.Ts / c.Ti, 1.0) * (out - c.bias - state[_INTEGRAL])
        return out
    free = c.bias + proportional + state[_INTEGRAL] + step
    out = min(max(free, lo), hi)
    if c.windup == 0:
        if not ((free > hi and step > 0.0) or (free < lo and step < 0.0)):
            state[_INTEGRAL] += step
        out = min(max(c.bias + proportional + state[_INTEGRAL], lo), hi)
    elif c.windup == 1:
        # tracking time Tt = Ti/2
        state[_INTEGRAL] += step + min(1.0, 2.0 * c.Ts / max(c.Ti, c.Ts)) * (out - free)
    else:
        state[_INTEGRAL] = min(max(state[_INTEGRAL] + step, lo - c.bias), hi - c.bias)
        out = min(max(c.bias + proportional + state[_INTEGRAL], lo), hi)
    return out


def execute(sp, pv, manual, state, c):
    """One scan: returns OP (%), rounded as it goes to valve and record.

    In manual OP stays, and both forms return to automatic without a bump.
    """
    e = _shaped(sp - pv, c)
    if state[_STARTED] == 0.0:
        state[_STARTED], state[ERROR], state[PV], state[OUT] = 1.0, e, pv, c.bias
        state[_SP0] = state[_SP] = sp
        state[_INTEGRAL] = -c.Kc * e if c.Ti > 0.0 else 0.0
    # what the proportional part sees; before, the scan before
    p, before = e, state[ERROR]
    if c.b != 1.0:
        p -= (1.0 - c.b) * (sp - state[_SP0])
        before -= (1.0 - c.b) * (state[_SP] - state[_SP0])
    d = 0.0
    if c.Td > 0.0:
        # filter Td/8, backward Euler
        keep = c.Td / 8.0 / (c.Td / 8.0 + c.Ts)
        moved = (pv - state[PV]) - c.c * (sp - state[_SP])
        d = keep * state[_DERIVATIVE] - c.Kc * c.Td * (1.0 - keep) * moved / c.Ts
    lo, hi = c.lo, c.hi
    if c.close_rate > 0.0:
        lo = max(lo, min(state[OUT] - c.close_rate * c.Ts, hi))
    step = _area(e, state[ERROR], c)
    if manual:
        out = state[OUT]
        if c.Ti > 0.0:
            state[_INTEGRAL] = out - c.bias - c.Kc * p - d
    elif c.velocity:
        out = min(max(state[OUT] + c.Kc * (p - before) + step + d - state[_DERIVATIVE], lo), hi)
    elif c.Ti > 0.0:
        out = positional(c.Kc * p + d, step, lo, hi, state, c)
    else:
        out = min(max(c.bias + c.Kc * p + d, lo), hi)
    state[ERROR], state[OUT], state[PV], state[_DERIVATIVE] = e, out, pv, d
    state[_SP] = sp
    if c.op_step > 0.0:
        out = round(out / c.op_step) * c.op_step
    if c.quantum > 0.0:
        out = round(out / c.quantum) * c.quantum
    return out


def take(sp, pv, out, state, c):
    """One scan in an operator's hand: OP (%) is his, rounded and limited as ever; the law goes on
    from it without a bump.
    """
    state[OUT] = min(max(out, c.lo), c.hi)
    return execute(sp, pv, True, state, c)


def watch(sp, pv, state, c):
    """A scan in which the controller does not run, but keeps track of SP and PV, as blocks that
    are executed out of turn do.
    """
    state[ERROR], state[PV], state[_SP] = _shaped(sp - pv, c), pv, sp


def at_rest():
    """Return the state of a controller before its first scan."""
    return np.zeros(8)
