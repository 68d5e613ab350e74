"""Installed characteristic, a stage: flow (% of full flow) against travel, in a line that takes
part of the pressure.

When to choose it: behind a friction model, when the loop gain should change with the operating
point: a gain that grows with opening (equal percentage) or falls (quick opening), or a valve whose
line takes most of the pressure.
When not: small cycles about one operating point; a gain does there. In a closed loop the flow at OP
= op0 is no longer op0, so the run starts with a step unless the operating point is chosen on the
curve.

inherent: linear f = x; equal percentage f = R^(x-1); quick opening f = sqrt(x), x = travel/100.
installed: flow = f / sqrt(N + (1 - N) f^2), N = authority, the share of the pressure that the open
valve takes. Equal percentage leaks 1/R at x = 0, as the inherent curve does; MV is the flow and
stays within 0..100.
"""

from math import exp, log, sqrt

from simbench.loop.parameters import Choice, Number

SOURCE = (
    "IEC 60534-2-4 (inherent characteristics); installed: Luyben (1990), Process Modeling,"
    " Simulation and Control"
)
FRICTION = False
PARAMETERS = {
    "type": Choice(("linear", "equal_percentage", "quick_opening"), says="inherent characteristic"),
    "R": Number("", low=1.0, positive=True, default=50.0, says="rangeability of equal percentage"),
    "authority": Number(
        "", low=0.0, high=1.0, positive=True, default=1.0, says="valve authority N"
    ),
}


def start(u0, p):
    """Return the state (flow,) at travel `u0` (%)."""
    return step(u0, (0.0,), p)


def step(u, state, p):
    """One sample: travel `u` (%) in, state (flow,) out, flow in % of full flow."""
    f = 0.01 * min(max(u, 0.0), 100.0)
    if p.type == 1.0:
        f = exp((f - 1.0) * log(p.R))
    elif p.type == 2.0:
        f = sqrt(f)
    if p.authority < 1.0:
        f = f / sqrt(p.authority + (1.0 - p.authority) * f * f)
    return (100.0 * f,)
