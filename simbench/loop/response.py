"""One OP series through one valve: the position a valve model takes, sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simbench.detectors.compiled import cached_module
from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import VALVES, valve_parameters

_TRACE = '''
@njit(cache=True, no_cfunc_wrapper=True)
def trace(op, state, p, mv):
    """Fill `mv` with the first entry of the state after every sample."""
    for k in range(op.size):
        state = step(op[k], state, p)
        mv[k] = state[0]
'''


def valve_response(
    model: str,
    op: ArrayLike,
    parameters: Mapping[str, Any] | None = None,
    Ts: float = 1.0,
    *,
    plain: bool = False,
) -> np.ndarray:
    """Return the valve position under an OP series."""
    # The valve's parameters for this sampling period
    module = VALVES.load(model)
    if not (np.isfinite(Ts) and Ts > 0.0):
        raise ParameterError(f"valve {model!r}: Ts = {Ts} s must be a finite number > 0")
    p = valve_parameters(module, parameters or {}, Ts)

    # One finite series
    op = np.ascontiguousarray(op, dtype=np.float64)
    if op.ndim != 1:
        raise ParameterError(
            f"valve {model!r}: OP must be one series, not an array of shape {op.shape}"
        )
    if not np.isfinite(op).all():
        raise ParameterError(
            f"valve {model!r}: OP is not finite at sample {int(np.argmin(np.isfinite(op)))}"
        )

    # From rest, sample by sample
    mv = np.empty(op.size)
    if op.size:
        state = tuple(float(s) for s in module.start(float(op[0]), p))
        if plain:
            for k, u in enumerate(op.tolist()):
                state = module.step(u, state, p)
                mv[k] = state[0]
        else:
            _compiled_trace(module.step)(op, state, p, mv)

    # A motion that did not end
    if np.isnan(mv).any():
        raise ParameterError(
            f"valve {model!r}: the motion of sample {int(np.argmax(np.isnan(mv)))} did not come to"
            " an end; a valve with less mass or more viscous friction is needed"
        )
    return mv


def stages_response(stages: tuple, op: np.ndarray, rest: float) -> np.ndarray:
    """Return what comes out of a chain of resolved valve stages under an OP series."""
    for module, p in stages:
        state = tuple(float(s) for s in module.start(rest, p))
        out = np.empty(op.size)
        _compiled_trace(module.step)(op, state, p, out)
        op = out
    return op


@cache
def _compiled_trace(step: FunctionType) -> Callable[..., None]:
    return cached_module("valve", {"step": step}, _TRACE).trace
