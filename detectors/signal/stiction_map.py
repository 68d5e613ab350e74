"""Compute the valve position from OP by the two-parameter (S, J) stiction model; plain Python,
compiled on demand.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.compiled import compiled
from simbench.detectors.errors import ParameterError

# v, d (last direction of motion: -1, 0, 1), moving (0 or 1), u_prev
_State = tuple[float, float, float, float]


def start(u0, lo=0.0, hi=100.0):
    """Return the state of a valve at rest in mid-band under OP `u0`, limits as in `step`."""
    x = min(max(u0, lo), hi)
    return (x, 0.0, 0.0, x)


def step(u, state, S, J, lo=0.0, hi=100.0):
    """Move the valve by one sample.

    Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641, in residual form: a
    valve at rest breaks away when |u - v| exceeds fs = (S + J)/2 and moves at the distance fd = (S
    - J)/2 from OP until OP turns or rests. Where the published flow chart is ambiguous,
    the place of rest is remembered until the valve moves. Not for noisy OP on a valve with inertia:
    every reversal of OP stops this valve.
    """
    v, d, moving, u_prev = state
    x = min(max(u, lo), hi)
    # standing still, or OP turned or stopped: only the stick band sets the valve moving (again)
    if moving == 0.0 or (x - u_prev) * d <= 0.0:
        if abs(x - v) <= 0.5 * (S + J):
            return (v, d, 0.0, x)
        d = 1.0 if x > v else -1.0
    return (min(max(x - d * 0.5 * (S - J), lo), hi), d, 1.0, x)


def _trace(op, S, J, state, lo, hi, v):
    """Fill `v` with the valve position under every sample of `op`, from `state` on; `step` in a
    loop.
    """
    for k in range(op.size):
        state = step(op[k], state, S, J, lo, hi)
        v[k] = state[0]


def valve_position(
    op, S: float, J: float, state: _State | None = None, limits=(0.0, 100.0)
) -> np.ndarray:
    """Return the position of an (S, J) valve driven by a recorded OP.

    Compiled at the first call (then read from numba's disk cache); bit-equal to calling `step`
    sample by sample.
    """
    for name, value in (("S", S), ("J", J)):
        if not 0.0 <= value < np.inf:
            raise ParameterError(
                f"valve_position: {name} = {value}; a finite number >= 0 is needed"
            )
    op = np.array(op, dtype=float)
    v = np.empty(op.size)
    if op.size:
        lo, hi = (float(x) for x in limits)
        first = start(float(op[0]), lo, hi) if state is None else tuple(float(x) for x in state)
        compiled(_trace)(op, float(S), float(J), first, lo, hi, v)
    return v
