"""Saturation: OP stops at tighter limits than 0..100.

When it is the answer: OP stands exactly at one value while the controller still pushes outward.
"""

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number

SOURCE = "definition: OP limited to lo..hi inside the controller, whose integral does not wind up"
BLOCK = "controller"
PARAMETERS = {
    "lo": Number("%", low=0.0, high=100.0, default=0.0, says="lower limit"),
    "hi": Number("%", low=0.0, high=100.0, default=100.0, says="upper limit"),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Narrow the controller's limits."""
    if p.lo >= p.hi:
        raise ParameterError(f"effect 'saturation': lo = {p.lo:g} must be below hi = {p.hi:g}")
    setup.op_lo = max(setup.op_lo, p.lo)
    setup.op_hi = min(setup.op_hi, p.hi)
