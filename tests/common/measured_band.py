"""Measure the stick band and slip-jump of a valve model, to compare them with those that it
states.
"""

from itertools import pairwise
from types import ModuleType
from typing import Any

import numpy as np

from simbench.loop.response import stages_response

_STEP = 0.02  # % of travel by which OP moves per sample: slow against the motion of every valve
# OP turns at ever other places: a valve that stops at every sample is met in every phase
_TURNS = (1.0, -1.0, 0.97, -1.03, 0.94, -0.91, 0.96, -0.99, 0.93, -0.95)
_NEAR = 0.15  # of S or J, besides the tolerance below
_BAND_TOLERANCE = 0.3  # % of travel: within both together, a measured number is as claimed


def measured_band(
    stages: list[tuple[ModuleType, Any]], reach: float, middle: float = 50.13
) -> tuple[float, float]:
    """Return the (S, J) that a chain of valve stages shows under an OP that creeps to and fro.

    A valve that slides meets S at every reversal, one that stops at every sample needs S to S + J,
    by its phase. A hysteresis of many plays shows their mean width.
    """
    ends = [0.0, *(reach * t for t in _TURNS)]
    branches = [np.arange(a, b, np.sign(b - a) * _STEP) for a, b in pairwise(ends)]
    op = middle + np.concatenate(branches)
    mv = stages_response(tuple(stages), op, float(op[0]))
    travels, jumps = [], []
    last = branches[0].size
    for branch in branches[1:]:
        way, first, last = np.sign(branch[1] - branch[0]), last, last + branch.size
        moved = way * np.diff(mv[first - 1 : last])
        slope = float(moved[moved.size // 2 :].mean())
        under_way = np.flatnonzero(moved > 0.5 * slope)
        if slope <= 1e-6 * _STEP or not under_way.size:
            return np.inf, 0.0
        # what OP had travelled when MV still stood
        travels.append(max(under_way[0] - 1, 0) * _STEP)
        jumps.append(float(moved.max()) - slope)
    return float(min(travels)), float(np.median(jumps))


def band_fault(stages: list[tuple[ModuleType, Any]], S: float, J: float) -> str:
    """Return in which way a chain of valve stages does not do what it maps on; "" when it does."""
    reach = float(np.clip(1.2 * S, 16.0, 48.0))
    if S == J == 0.0 and _without_memory(stages, reach):
        return ""
    found_S, found_J = measured_band(stages, reach)
    if not np.isfinite(found_S):
        return f"maps on S = {S:g}, but MV never follows a reversal of OP"
    if abs(found_S - S) > _NEAR * S + _BAND_TOLERANCE:
        return (
            f"maps on S = {S:g}, but MV follows a reversal of OP only after {found_S:.3g} % of"
            " travel"
        )
    if abs(found_J - J) > _NEAR * J + _BAND_TOLERANCE:
        return f"maps on J = {J:g}, but MV slips by {abs(round(found_J, 2)):g} % of travel"
    return ""


def _without_memory(
    stages: list[tuple[ModuleType, Any]], reach: float, middle: float = 50.13
) -> bool:
    """Return whether MV takes the same way up and down: at a travel stop it does not move
    either, but holds nothing back.
    """
    up = middle + np.arange(-reach, reach, 50 * _STEP)
    mv = stages_response(tuple(stages), np.concatenate([up, up[::-1]]), float(up[0]))
    return bool(np.array_equal(mv[: up.size], mv[up.size :][::-1]))
