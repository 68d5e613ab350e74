"""One OP series through one valve: the position a valve model takes, sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from detectors.errors import ParameterError
from simbench.loop import kernel
from simbench.loop.parameters import VALVES, valve_parameters

_TRACE = '''
@njit(cache=True)
def trace(op, state, p, mv):
    """Fill `mv` with the first entry of the state after every sample."""
    for k in range(op.size):
        state = step(op[k], state, p)
        mv[k] = state[0]
'''


def valve_response(
    model: str, op: ArrayLike, parameters: Mapping[str, Any] | None = None, Ts: float = 1.0, *, plain: bool = False
) -> np.ndarray:
    """Return the valve position under an OP series.

    Parameters
    ----------
    model : str
        A valve model or stage, see `VALVES.names()`.
    op : array_like, shape (n,)
        Controller output, % of travel; values outside 0..100 act as their limit.
    parameters : mapping, optional
        The model's parameters.
    Ts : float
        Sampling period, s; the models without time of their own ignore it.
    plain : bool
        Run in Python sample by sample instead of compiled; the result is the same, bit for bit.

    Returns
    -------
    ndarray, shape (n,)
        Valve position MV, % of travel. The valve starts at rest in mid-band under op[0].

    Raises
    ------
    UnknownName, ParameterError
        For an unknown model or parameter, a value out of range, OP that is not finite, or a solver that gave up.

    Examples
    --------
    >>> valve_response("choudhury", [50.0, 52.0, 54.0, 56.0, 55.0], {"S": 5.0, "J": 2.0})
    array([50. , 50. , 52.5, 54.5, 54.5])
    """
    module = VALVES.load(model)
    if not (np.isfinite(Ts) and Ts > 0.0):
        raise ParameterError(f"valve {model!r}: Ts = {Ts} s must be a finite number > 0")
    p = valve_parameters(module, parameters or {}, Ts)
    op = np.ascontiguousarray(op, dtype=np.float64)
    if op.ndim != 1:
        raise ParameterError(f"valve {model!r}: OP must be one series, not an array of shape {op.shape}")
    if not np.isfinite(op).all():
        raise ParameterError(f"valve {model!r}: OP is not finite at sample {int(np.argmin(np.isfinite(op)))}")
    mv = np.empty(op.size)
    if op.size:
        state = tuple(float(s) for s in module.start(float(op[0]), p))
        if plain:
            for k, u in enumerate(op.tolist()):
                state = module.step(u, state, p)
                mv[k] = state[0]
        else:
            _compiled_trace(module.step)(op, state, p, mv)
    if np.isnan(mv).any():
        raise ParameterError(
            f"valve {model!r}: the motion of sample {int(np.argmax(np.isnan(mv)))} did not come to an end; "
            "a valve with less mass or more viscous friction does"
        )
    return mv


@cache
def _compiled_trace(step: FunctionType) -> Callable[..., None]:
    return kernel.cached_module("valve", {"step": step}, _TRACE).trace
