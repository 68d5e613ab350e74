"""Compiled kernels of the prediction error: find for each segment of a signal its nearest segments,
by comparing all pairs.

Plain Python, their own slow twins; `detectors.compiled.compiled` gives them at full speed. Pieces
stand side by side, `LANES` at a time, so that a comparison is one instruction; a tree does not pay
for a few hundred pieces of ten samples.
"""

from __future__ import annotations

import numpy as np

from detectors.compiled import LANES, lanes

MOST_NEIGHBOURS = 8  # neighbours, one list of `nearest` each


def predicted(x, embedding, horizon, neighbours):
    """Return the squared error of predicting `x` from what followed the nearest look-alikes of each
    piece.

    Pieces of `embedding` samples that overlap are no look-alikes. Of look-alikes equally far, the
    last that fit all count.
    """
    m = x.size - horizon - embedding + 1
    far = _distances(x, embedding, m)
    edge = nearest(far, embedding, m, neighbours)
    ahead = x[embedding - 1 + horizon :]
    guess, count = np.zeros(m), np.zeros(m)
    for lag in range(embedding, m):
        row = far[lag, LANES:]
        for i in range(m - lag):
            if row[i] <= edge[i]:
                guess[i] += ahead[i + lag]
                count[i] += 1.0
        for i in range(lag, m):
            if row[i - lag] <= edge[i]:
                guess[i] += ahead[i - lag]
                count[i] += 1.0
    total = 0.0
    for i in range(m):
        if count[i] > 0.0:
            total += (ahead[i] - guess[i] / count[i]) ** 2
    return total


def _distances(x, embedding, m):
    """Return far[lag, LANES + i], the squared distance of pieces i and i + lag of `m`; infinite
    beyond the last pair.
    """
    far = np.full((m, m + 2 * LANES), np.inf)
    square = np.empty(x.size)
    for lag in range(embedding, m):
        for t in range(m - lag + embedding - 1):
            square[t] = (x[t] - x[t + lag]) * (x[t] - x[t + lag])
        row = far[lag, LANES:]
        for i in range(m - lag):
            row[i] = square[i]
        for t in range(1, embedding):
            for i in range(m - lag):
                row[i] += square[i + t]
    return far


def nearest(far, embedding, m, neighbours):
    """Return the squared distance of each piece's look-alike number `neighbours` (1 to MOST);
    infinite if it has fewer.
    """
    edge = np.empty(m + LANES)
    n0, n1, n2, n3, n4, n5, n6, n7 = (
        lanes(),
        lanes(),
        lanes(),
        lanes(),
        lanes(),
        lanes(),
        lanes(),
        lanes(),
    )
    for start in range(0, m, LANES):
        for c in range(LANES):
            # smallest first; lists that are not wanted are full from the beginning
            n0[c] = -np.inf if neighbours < 8 else np.inf
            n1[c] = -np.inf if neighbours < 7 else np.inf
            n2[c] = -np.inf if neighbours < 6 else np.inf
            n3[c] = -np.inf if neighbours < 5 else np.inf
            n4[c] = -np.inf if neighbours < 4 else np.inf
            n5[c] = -np.inf if neighbours < 3 else np.inf
            n6[c] = -np.inf if neighbours < 2 else np.inf
            n7[c] = np.inf
        for earlier in range(2):
            last = min(start + LANES, m) if earlier else m - start
            for lag in range(embedding, last):
                row = far[lag]
                # an unsigned index: a negative one would be looked up one by one
                at = np.uintp(LANES + start - earlier * lag)
                for c in range(LANES):
                    a = row[at + np.uintp(c)]
                    b = max(n0[c], a)
                    n0[c] = min(n0[c], a)
                    a = max(n1[c], b)
                    n1[c] = min(n1[c], b)
                    b = max(n2[c], a)
                    n2[c] = min(n2[c], a)
                    a = max(n3[c], b)
                    n3[c] = min(n3[c], b)
                    b = max(n4[c], a)
                    n4[c] = min(n4[c], a)
                    a = max(n5[c], b)
                    n5[c] = min(n5[c], b)
                    b = max(n6[c], a)
                    n6[c] = min(n6[c], a)
                    n7[c] = min(n7[c], b)
        for c in range(LANES):
            edge[start + c] = n7[c]
    return edge
