"""One OP series through one valve: the position a valve model takes, sample by sample; from arrays
or from a file.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from simbench.detectors.compiled import cached_module
from simbench.detectors.errors import ParameterError, RecordError
from simbench.detectors.records.clock import seconds
from simbench.detectors.records.dialects import words
from simbench.detectors.records.gaps import JITTER
from simbench.detectors.records.historian import read_numbers
from simbench.detectors.records.tables import read_sheet
from simbench.files import plain_cell, refuse_kind, whole_file
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
    module = VALVES.load(model)
    if not (np.isfinite(Ts) and Ts > 0.0):
        raise ParameterError(f"valve {model!r}: Ts = {Ts} s must be a finite number > 0")
    p = valve_parameters(module, parameters or {}, Ts)
    op = np.ascontiguousarray(op, dtype=np.float64)
    if op.ndim != 1:
        raise ParameterError(
            f"valve {model!r}: OP must be one series, not an array of shape {op.shape}"
        )
    if not np.isfinite(op).all():
        raise ParameterError(
            f"valve {model!r}: OP is not finite at sample {int(np.argmin(np.isfinite(op)))}"
        )
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


def valve_file(
    source: str | Path,
    out: str | Path,
    model: str,
    parameters: Mapping[str, Any] | None = None,
) -> None:
    """Send the column `op` of a table through one valve model."""
    refuse_kind(out)
    sheet = read_sheet(Path(source))
    table = sheet.columns
    names = {name.lower(): name for name in table}
    if "op" not in names:
        raise RecordError(f"{source}: no column op; columns are: {', '.join(table)}")
    op = read_numbers(sheet, [names["op"]], str(source))[names["op"]]
    empty = np.flatnonzero(np.isnan(op))
    if empty.size:
        raise RecordError(
            f"{source}, line {empty[0] + 2}: {names['op']} is empty; a valve needs OP at every"
            " sample"
        )
    Ts = 1.0
    time = next((names[name] for name in words("time") if name in names), None)
    if time is not None and op.size > 1:
        step = np.diff(seconds(table[time], time, str(source)))
        Ts = float(np.median(step))
        uneven = np.flatnonzero(np.abs(step - Ts) > JITTER * Ts)
        if uneven.size:
            at = uneven[0] + 3
            dt = step[uneven[0]]
            raise RecordError(
                f"{source}, line {at}: a time step of {dt:g} s among steps of {Ts:g} s; even steps"
                " are needed"
            )
    columns = {name: cells for name, cells in table.items() if name.lower() != "mv"}
    columns["mv"] = valve_response(model, op, parameters or {}, Ts).tolist()
    with whole_file(out) as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(map(plain_cell, columns))
        writer.writerows(map(plain_cell, row) for row in zip(*columns.values()))


@cache
def _compiled_trace(step: FunctionType) -> Callable[..., None]:
    return cached_module("valve", {"step": step}, _TRACE).trace
