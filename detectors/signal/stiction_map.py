"""Compute the position of an (S, J) valve under a recorded OP."""

from __future__ import annotations

import numpy as np

from simbench.detectors.compiled import compiled
from simbench.detectors.errors import ParameterError
from simbench.valve.maps import at_rest, stick


def _trace_valve(op, S, J, state, lo, hi, v):
    """Fill `v` with the valve position under every sample of `op`, from `state` on."""
    for k in range(op.size):
        state = stick(op[k], state, S, J, lo, hi)
        v[k] = state[0]


def valve_position(
    op, S: float, J: float, state: tuple[float, ...] | None = None, limits=(0.0, 100.0)
) -> np.ndarray:
    """Return the position of an (S, J) valve driven by a recorded OP.

    Compiled at the first call (then read from numba's disk cache); bit-equal to calling
    `simbench.valve.maps.stick` sample by sample, of which `state` is a state.
    """
    # Sizes are finite numbers
    for name, value in (("S", S), ("J", J)):
        if not 0.0 <= value < np.inf:
            raise ParameterError(
                f"valve_position: {name} = {value}; a finite number >= 0 is needed"
            )

    # The valve rests where OP begins, or as the state says
    op = np.array(op, dtype=float)
    v = np.empty(op.size)
    if op.size:
        lo, hi = (float(x) for x in limits)
        if state is None:
            first = at_rest(float(op[0]), lo, hi)
        else:
            first = tuple(float(x) for x in state)
        compiled(_trace_valve)(op, float(S), float(J), first, lo, hi, v)
    return v
