"""Recognise an OP that is sent only after a change of a least size: a threshold in the
controller.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.thresholds import STEP_LEAST, STEP_RESTS

_FEWEST = 8  # moves
_LATTICE = 0.05  # of the least move, within which all moves are multiples of it: that is rounding


def least_step(op: np.ndarray) -> float | None:
    """Return the least size (unit of OP) by which OP (n,) moves, where it rests in between and
    moves by any larger size; None where it does not.
    """
    moves = np.abs(np.diff(op))
    moved = moves[moves > 0.0]
    if moved.size < _FEWEST or moved.size > (1.0 - STEP_RESTS) * moves.size:
        return None
    least = float(moved.min())
    if least < STEP_LEAST * float(np.ptp(op)):
        return None
    ratio = moved / least
    return None if np.all(np.abs(ratio - np.round(ratio)) <= _LATTICE) else least
