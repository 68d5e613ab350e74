"""Find out why OP is exactly constant: at a limit, in a dead-band of the error, or because the
controller was not executed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from simbench.gap.controller.law import EXACT, about_zero, solve_by_majority

# pairs of samples at one extreme of OP, from which it is a limit if OP rests nowhere else: without
# it one of 11 limits in 164 records is overlooked
_RESTS = 6
# share of samples in which OP rests away from its extremes; above it, rests at the extremes can be
# chance
_OFTEN = 0.01
# share of OP's range at one end of it, in which its turning points are looked at, and the chance
# that as many of them are at the very same extreme without a limit, below which there is one
_END = 0.1
_BY_CHANCE = 1e-4
# steps of OP's lattice that this end must hold: OP that wavers between two turns at the outer one
_FEWEST_STEPS = 3.0
# turning points at an extreme, beyond which it is a limit though OP neither rests nor is pushed
# there: of fewer one was a healthy record's
_COMES = 5
# times what a law may leave, by which it would move OP where it was not computed
_FAR = 3.0
# share of the rarer kind of samples, resting or moving, that a band must separate from the other;
# less can be chance
_SEPARATED = 0.4


def limits_of(
    op: np.ndarray,
    e: np.ndarray,
    a: float,
    b: float,
    step: float,
    unit: float,
    hidden: float = 0.0,
) -> dict[str, float]:
    """Return the extremes at which OP rests while the controller pushes outward; of changes up to
    `hidden` (%) nobody knows whether it rests.
    """
    # Where OP would have moved, and stood
    out = {}
    lo = float(op.min())
    hi = float(op.max())
    asked = a * e[1:] + b * e[:-1]
    margin = max(0.6 * step, 3.0 * unit, hidden, 1e-6 * float(np.ptp(op)))
    still = (np.diff(op) == 0.0) & (np.abs(asked) >= hidden)
    at_ends = np.count_nonzero(still & ((op[1:] == lo) | (op[1:] == hi)))
    elsewhere = np.count_nonzero(still) - at_ends

    # Each extreme: whether the law pushes against it, or OP comes back to it
    for name, edge, sign in (("hi", hi, 1.0), ("lo", lo, -1.0)):
        at = np.abs(op[1:] - edge) < 1e-9 * max(abs(edge), 1.0)
        pushed = at & (sign * (op[:-1] + asked - edge) > margin)
        # standing twice at the very same extreme does not happen to an unlimited OP, unless it
        # often rests
        repeated = at & np.append(False, at[:-1]) & still
        fine = step == 0.0 and elsewhere <= _OFTEN * op.size
        pushes = pushed.sum() >= 0.7 * at.sum()
        # a controller of another law need not push, nor one whose OP leaves the limit at once rest
        # there: but OP rests nowhere else, or comes back to this value and never passes it
        stands = repeated.sum() >= _RESTS
        back = comes_back(sign * op, max(step, unit), 1 if stands or pushes else _COMES)
        if back or (stands and at_ends > 9 * elsewhere) or (fine and pushes and pushed.sum() >= 2):
            out[name] = edge
    return out


def comes_back(op: np.ndarray, unit: float, least: int = 1) -> bool:
    """Return whether more of OP's turning points (n,) lie at its very maximum than chance brings:
    where nothing limits OP, they get rarer towards it.
    """
    moves = np.flatnonzero(np.append(True, np.diff(op) != 0.0))
    x = op[moves]
    turns = x[1:-1][(x[1:-1] > x[:-2]) & (x[1:-1] > x[2:])]
    near = turns[turns >= x.max() - _END * np.ptp(x)]
    end = _END * float(np.ptp(x))
    if end < _FEWEST_STEPS * unit:
        return False
    chance = unit / (end or 1.0)
    at_maximum = int(np.count_nonzero(near == x.max()))
    rare = scipy.special.bdtrc(at_maximum - 1, near.size, chance) < _BY_CHANCE
    return bool(at_maximum > least and rare)


def error_gap(still: np.ndarray, e: np.ndarray, rows: np.ndarray) -> float:
    """Return the width of the band of |e| within which, and only within which, OP is `still`
    (n - 1,), 0 when there is none.
    """
    if still[rows].sum() < 8:
        return 0.0

    # still exactly when this error and the one before are inside the band
    reach = np.maximum(np.abs(e[1:]), np.abs(e[:-1]))[rows]
    still = still[rows]
    if np.median(reach[still]) <= 1e-9 * max(float(np.abs(e).max()), 1e-12):
        return 0.0  # an error of exactly 0, as a coarse PV has it, moves no OP anyway
    order = np.argsort(reach)
    hits = np.cumsum(np.where(still[order], 1, -1))
    split = int(np.argmax(hits))
    if split + 1 >= reach.size:
        return 0.0
    edge = 0.5 * (reach[order[split]] + reach[order[split + 1]])
    wrong = np.count_nonzero(still != (reach <= edge))
    agree = 1.0 - wrong / max(min(still.sum(), (~still).sum()), 1)
    if agree > _SEPARATED:
        return 2.0 * float(edge)
    return 0.0


def skips_scans(
    op: np.ndarray,
    e: np.ndarray,
    error_at: Callable[[np.ndarray], np.ndarray],
    free: np.ndarray,
    size: float,
    unit: float,
    exact: float = EXACT,
) -> bool:
    """Return whether OP rests exactly in some `free` changes (n - 1,) and obeys a PI law from one
    move to the next, up to the share `exact` of what is left of it; `error_at` gives the errors at
    the samples in which the controller ran.
    """
    still = np.diff(op) == 0.0
    by_chance = min(unit / (2.5 * size), 1.0)  # that a rounded OP repeats itself
    if (still & free).sum() < max(5.0, 3.0 * by_chance * free.sum()):
        return False
    moves = np.append(0, np.flatnonzero(~still) + 1)
    if moves.size < 30:
        return False
    of_runs = error_at(moves)
    du = np.diff(op[moves])
    now = of_runs[1:]
    before = of_runs[:-1]
    rows = free[moves[1:] - 1] & free[np.maximum(moves[:-1] - 1, 0)]
    X = np.column_stack([now, before])[rows]
    y = du[rows]
    law = solve_by_majority(X, y)
    usual = about_zero(y) or 1.0
    left = float(np.quantile(np.abs(y - X @ law), 0.8))

    # nearly every move obeys, and would move OP where it stands
    asked = np.abs(np.column_stack([e[1:], e[:-1]]) @ law)[still & free]
    return bool(left < exact * usual and np.mean(asked > _FAR * left) > 0.5)
