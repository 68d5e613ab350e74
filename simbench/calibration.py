"""Measure the calibration of probabilities: how far stated probabilities differ from observed
frequencies.
"""

from __future__ import annotations

import numpy as np


def calibration_error(stated: np.ndarray, right: np.ndarray, bins: int = 10) -> float:
    """Return the expected calibration error (Naeini et al. 2015), equal-width bins."""
    place = np.minimum((stated * bins).astype(int), bins - 1)
    return float(
        sum(
            abs(right[place == b].mean() - stated[place == b].mean()) * np.mean(place == b)
            for b in np.unique(place)
        )
    )
