"""How stable a ranking is: how often the winner wins on half of the loops, and which neighbours an
exact test separates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from simbench.bench.score.pairing import Paired
from simbench.bench.statistics import holm

HALVES = 50
_LEVEL = 0.05


@dataclass(frozen=True)
class RankStability:
    """How far the order of some methods depends on the loops that were drawn."""

    winner: str | None = None  # the method of lowest cost; None where no two methods are ranked
    wins: int = 0  # of `HALVES` random halves of the groups: in how many no other method costs less
    # first, second (adjacent in the ranking), only_first, only_second (loops that only one got
    # right), p (exact McNemar test with Holm's correction), separated
    pairs: tuple[dict[str, Any], ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return JSON types."""
        return {
            "winner": self.winner,
            "wins": self.wins,
            "halves": HALVES,
            "pairs": list(self.pairs),
        }


def stability(
    earned: Mapping[str, np.ndarray], right: Mapping[str, np.ndarray], groups: np.ndarray, seed: int
) -> RankStability:
    """Rank methods on random halves of the groups, and test neighbours of the whole ranking.

    `earned`: 1 less the cost of every answer; `right`: whether it was right; both (n,) by method.
    McNemar (1947), Holm (1979).
    """
    order = sorted(earned, key=lambda method: -float(earned[method].mean()))
    if len(order) < 2:
        return RankStability()
    _, place = np.unique(groups, return_inverse=True)
    sums = np.array([np.bincount(place, earned[method]) for method in order])
    rng, wins = np.random.default_rng(seed), 0
    for _ in range(HALVES):
        half = np.zeros(sums.shape[1])
        half[rng.permutation(half.size)[: max(half.size // 2, 1)]] = 1.0
        total = sums @ half
        # sums of the same loops: equal but for rounding
        wins += bool(total[0] >= total.max() - 1e-9)
    neighbours = list(pairwise(order))
    found = [Paired.of(right[first], right[second]) for first, second in neighbours]
    p = holm([paired.p for paired in found])
    names = ("first", "second", "only_first", "only_second", "p", "separated")
    rows = (
        (*names_of, paired.win, paired.loss, float(q), bool(q < _LEVEL))
        for names_of, paired, q in zip(neighbours, found, p, strict=True)
    )
    pairs = (dict(zip(names, row, strict=True)) for row in rows)
    return RankStability(order[0], wins, tuple(pairs))
