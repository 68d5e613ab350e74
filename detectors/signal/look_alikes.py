"""Compute the prediction error of the detector `surrogate`: find for each segment of a signal its
nearest segments, by comparing all pairs.

The functions also run, slowly, as plain Python; `simbench.detectors.compiled.compiled` compiles
them. Pieces stand side by side, `LANES` at a time, so that a comparison is one instruction; a tree
does not pay for a few hundred pieces of ten samples.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.compiled import LANES, lanes, wide

MOST_NEIGHBOURS = 8  # neighbours, one list of `nearest` each


def prediction_errors(x, embedding, horizon, neighbours):
    """Return the squared error of predicting `x` from what followed the nearest look-alikes of each
    piece.

    Pieces of `embedding` samples that overlap are no look-alikes. Of look-alikes equally far, the
    last that fit all count.
    """
    wide()
    m = x.size - horizon - embedding + 1
    far = _distances(x, embedding, m)
    edge = nearest(far, embedding, m, neighbours)
    # what follows each piece; beyond the ends no piece is near
    ahead = np.zeros(m + 3 * LANES)
    for i in range(m):
        ahead[LANES + i] = x[embedding - 1 + horizon + i]
    guess, count, bound = lanes(), lanes(), lanes()
    total = 0.0
    for start in range(0, m, LANES):
        for c in range(LANES):
            guess[c] = count[c] = 0.0
            bound[c] = edge[start + c]
        for lag in range(embedding, m):
            row = far[lag]
            # an unsigned index: a negative one would be looked up one by one
            for at, other in ((start, start + lag), (start - lag, start - lag)):
                if -LANES < at < m - lag:
                    here, there = np.uintp(LANES + at), np.uintp(LANES + other)
                    for c in range(LANES):
                        near = row[here + np.uintp(c)] <= bound[c]
                        guess[c] += ahead[there + np.uintp(c)] if near else 0.0
                        count[c] += 1.0 if near else 0.0
        for c in range(min(LANES, m - start)):
            if count[c] > 0.0:
                total += (ahead[LANES + start + c] - guess[c] / count[c]) ** 2
    return total


def _distances(x, embedding, m):
    """Return far[lag, LANES + i], the squared distance of pieces i and i + lag of `m`; infinite
    beyond the first and the last pair.
    """
    wide()
    far = np.empty((m, m + 3 * LANES))
    square, pair = np.zeros(x.size + 2 * LANES), np.zeros(x.size + 2 * LANES)
    total = lanes()
    for lag in range(embedding, m):
        row, later, pairs = far[lag], x[lag:], m - lag
        for t in range(pairs + embedding - 1):
            square[t] = (x[t] - later[t]) * (x[t] - later[t])
        # two samples at a time: half as many sums
        for t in range(pairs + embedding - 1):
            pair[t] = square[t] + square[t + 1]
        for c in range(LANES):
            row[c] = np.inf
        for start in range(0, pairs, LANES):
            for c in range(LANES):
                total[c] = square[start + c] if embedding % 2 == 1 else 0.0
            for t in range(start + embedding % 2, start + embedding, 2):
                at = np.uintp(t)
                for c in range(LANES):
                    total[c] += pair[at + np.uintp(c)]
            at = np.uintp(LANES + start)
            for c in range(LANES):
                row[at + np.uintp(c)] = total[c]
        for i in range(LANES + pairs, 2 * LANES + pairs):
            row[i] = np.inf
    return far


def nearest(far, embedding, m, neighbours):
    """Return the squared distance of each piece's look-alike number `neighbours` (1 to MOST);
    infinite if it has fewer.
    """
    wide()
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
