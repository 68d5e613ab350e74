"""Compute the prediction error of the detector `surrogate`: find for each segment of a signal its
nearest segments, by comparing all pairs.

The function also runs, slowly, as plain Python; `simbench.detectors.compiled.compiled` compiles it.
A tree does not pay for a few hundred pieces of ten samples.
"""

from __future__ import annotations

import numpy as np


def prediction_errors(x, embedding, horizon, neighbours):
    """Return the squared error of predicting `x` from what followed the nearest look-alikes of each
    piece.

    Pieces of `embedding` samples that overlap are no look-alikes. Of look-alikes equally far, the
    last that fit all count.
    """
    m = x.size - horizon - embedding + 1
    far = np.empty(m)
    nearest = np.empty(neighbours)
    ahead = x[embedding - 1 + horizon :]
    total = 0.0
    for i in range(m):
        far[:] = 0.0
        for t in range(embedding):
            here = x[i + t]
            there = x[t:]
            for j in range(m):
                far[j] += (here - there[j]) * (here - there[j])
        far[max(i - embedding + 1, 0) : i + embedding] = np.inf
        nearest[:] = np.inf  # the least distances, in order
        for j in range(m):
            if far[j] < nearest[neighbours - 1]:
                place = neighbours - 1
                while place > 0 and nearest[place - 1] > far[j]:
                    nearest[place] = nearest[place - 1]
                    place -= 1
                nearest[place] = far[j]
        guess = count = 0.0
        for j in range(m):
            if far[j] <= nearest[neighbours - 1] and far[j] < np.inf:
                guess += ahead[j]
                count += 1.0
        if count > 0.0:
            total += (ahead[i] - guess / count) ** 2
    return total
