"""How large a loss would a paired comparison have found? The power of the exact one-sided McNemar
test that `check` makes, for as many answers as are won beside those that are lost.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import optimize, stats

POWER = 0.8  # with which a loss must be found


def smallest_loss_found(n: int, level: float, won: int = 0, least: int = 0) -> float:
    """Return the smallest net loss, a share of n answers, that a one-sided exact test at a level
    finds with `POWER` where about `won` answers are won beside it; 1 where none is.

    Answers lost and won are counts of Poisson; only more than `least` net ones fail, however sure.

    >>> round(smallest_loss_found(1000, 0.05), 4), round(smallest_loss_found(1000, 0.05, 40), 4)
    (0.0067, 0.0265)
    """
    if n == 0:
        return 1.0
    also_won = np.arange(stats.poisson.ppf(1e-6, won), stats.poisson.ppf(1.0 - 1e-6, won) + 1.0)
    chance = stats.poisson.pmf(also_won, won)
    needed = np.maximum(_least_lost(also_won, level), also_won + least + 1.0)

    def missed(share: float) -> float:
        """Return how far the power for a net loss is below what is asked for."""
        return POWER - float(chance @ stats.poisson.sf(needed - 1.0, won + n * share))

    if missed(1.0) > 0.0:
        return 1.0
    return float(optimize.brentq(missed, 0.0, 1.0, xtol=1e-5))


def loops_for(loss: float, level: float) -> int:
    """Return of how many answers a net loss is found where none is won beside it.

    >>> loops_for(0.0067, 0.05)
    1004
    """
    return math.ceil(stats.gamma.ppf(POWER, math.ceil(-math.log2(level))) / loss)


def _least_lost(won: np.ndarray, level: float) -> np.ndarray:
    """Return how many answers at least must be lost beside each number of won ones for the test to
    take them for a loss.
    """
    # by the normal approximation, then exactly
    z = stats.norm.isf(level)
    lost = np.floor(won + z * np.sqrt(2.0 * won) + 0.5 * z * z)
    while (low := stats.binom.sf(lost - 1.0, lost + won, 0.5) >= level).any():
        lost = lost + low
    while (high := stats.binom.sf(lost - 2.0, lost - 1.0 + won, 0.5) < level).any():
        lost = lost - high
    return lost
