"""Tell valves (S, J) that are different from those that are next to each other."""

from __future__ import annotations

import numpy as np

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
