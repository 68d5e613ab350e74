"""The maps from OP to the position of a valve, each as one step of plain Python, which kernels
compile, and which valves (S, J) are different.

OP `u`, positions and sizes are in one unit; travel ends at `lo` and `hi`, in % unless stated
otherwise.
"""

from __future__ import annotations

import numpy as np


def play(u, v, S, lo=0.0, hi=100.0):
    """Return the position of a valve with dead-band S that stood at `v`; it has no memory of its
    direction.

    Source: ISA-51.1 (1979), dead band; the play operator.
    """
    x = min(max(u, lo), hi)
    half = 0.5 * S
    return max(x - half, min(x + half, v))


def zone(u, D, c, lo=0.0, hi=100.0):
    """Return the position of a valve that ignores OP within D/2 of `c`; it has no memory.

    Source: ISA-51.1 (1979), dead zone.
    """
    x = min(max(u, lo), hi)
    half = 0.5 * D
    if x > c + half:
        return x - half
    if x < c - half:
        return x + half
    return c


def at_rest(u, lo=0.0, hi=100.0):
    """Return the state (v, d, moving, u_prev) of `stick` at rest in mid-band under OP `u`."""
    x = min(max(u, lo), hi)
    return (x, 0.0, 0.0, x)


def stick(u, state, S, J, lo=0.0, hi=100.0):
    """Move a valve that sticks, then slides with OP; return its state (v, d, moving, u_prev), d the
    last direction of motion.

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


def creep(u, v, S, J, K=1.0, lo=0.0, hi=100.0):
    """Return the position of a valve that stood at `v` and sticks again after every sample; K is
    the gain on its slip.

    He, Wang, Pottmann and Qin (2007), Ind. Eng. Chem. Res. 46, 4549-4560; K: He and Wang (2010),
    ACC.
    """
    x = min(max(u, lo), hi)
    c = x - v
    fd = 0.5 * (S - J)
    # v + K (c - fd) with v + c = x put in first: without rounding where K = 1
    if c > 0.5 * (S + J):
        return min(max((x - fd) + (K - 1.0) * (c - fd), lo), hi)
    if c < -0.5 * (S + J):
        return min(max((x + fd) + (K - 1.0) * (c + fd), lo), hi)
    return v


# --- Tell valves (S, J) that are different from those that are next to each other.

# differences of log S and of J/S from which on two valves are different: the true peak of a
# likelihood or an error is a few percent wide in S
SIZES_APART = 0.08
SHARES_APART = 0.2


def distinct_valves(
    points: np.ndarray, errors: np.ndarray, most: int, share: float = 1.0
) -> np.ndarray:
    """Return the indices of the best of many valves, at most `most`, the best first, that lie in
    different cells of log S and J/S.

    `points` (p, 2 or more): S, J and whatever; `errors` (p,); cells are `share` times as wide as
    differences tell.
    """
    order = np.argsort(errors, kind="stable")
    S = points[order, 0]
    J = points[order, 1]
    cells = np.column_stack([np.log(S), J / S]) // (share * np.array([SIZES_APART, SHARES_APART]))
    first = np.sort(np.unique(cells, axis=0, return_index=True)[1])
    return order[first[:most]]
