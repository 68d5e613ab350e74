"""P and PI controllers: one sample each, and the same law as a transfer function for the theory."""

from __future__ import annotations

from collections import namedtuple

# numba tells named tuples apart by their names: no two in the loop may share one
PI = namedtuple("PI", "Kc Ki lo hi")
P = namedtuple("P", "Kc op0 lo hi")
NoGap = namedtuple("NoGap", "unused")
Gap = namedtuple("Gap", "half_band step")


def pi_start(op0, e0):
    """Return the state (OP, previous error) at rest; the first error counts as a change from `e0`."""
    return op0, e0


def pi_step(e, state, p):
    """One sample of PI in velocity form: the backward-Euler integral, limited to lo..hi.

    Limiting OP itself is the anti-windup: the integral takes up whatever the limit cut off, so OP leaves the limit at once
    when the error turns. `p.Kc` carries the sign of the direction, `p.Ki` = Kc Ts/Ti.
    """
    u = state[0] + (p.Kc * (e - state[1]) + p.Ki * e)
    return min(max(u, p.lo), p.hi), e


def p_start(op0, e0):
    """Return the state of a P controller; it has no memory."""
    return op0, e0


def p_step(e, state, p):
    """One sample of P: OP = op0 + Kc e, limited to lo..hi."""
    return min(max(p.op0 + p.Kc * e, p.lo), p.hi), e


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
    return p.step * float(round(u / p.step)) if p.step > 0.0 else u


def transfer_function(controller):
    """Return C(s), from error to OP, of a loop file's controller.

    Examples
    --------
    >>> from scenarios.spec import Controller
    >>> transfer_function(Controller(type="PI", Kc=2, Ti=10)).num[0][0].tolist()
    [20.0, 2.0]
    """
    import control

    gain = controller.sign * controller.Kc
    if controller.type == "P":
        return control.tf([gain], [1.0])
    return control.tf([gain * controller.Ti, gain], [controller.Ti, 0.0])
