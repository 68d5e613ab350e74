"""Compute for each detector, from simulated replicates of a loop, false-positive rate, sensitivity
over S and J, an advised threshold, and the smallest visible stiction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from simbench.bench.statistics import wilson
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

POWER = 0.8  # sensitivity from which a size is called visible
_ALARMS = 0.05  # share of healthy replicates that a threshold chosen here may call sticky
# by which a threshold chosen here must be right more often than the published rule to be advised
_BETTER = 0.03
_DRAWS = 200  # of the shares found, for the range of the smallest visible size
_Z = 1.96  # standard deviations of a 95 % interval


@dataclass(frozen=True)
class Cell:
    """Share of the replicates with one S and J (% of travel) called stiction, and its 95 %
    interval.
    """

    S: float
    J: float
    share: float
    lo: float
    hi: float
    n: int  # replicates


@dataclass(frozen=True, eq=False)
class Rule:
    """How a method should be read on this loop: by its published rule, or by the score above which
    stiction is called.

    `right` is the share of replicates answered right, sticky and healthy ones counting the same; an
    abstention is not right. `hits` (n,) are the replicates answered right.
    """

    method: str
    cut: float | None
    right: float
    hits: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=bool), repr=False)

    def verdict_of(self, verdict: Verdict) -> str:
        """Return what this rule reads out of a verdict."""
        if self.cut is None:
            return verdict.verdict
        return (
            STICTION
            if verdict.score > self.cut
            else NO_STICTION
            if np.isfinite(verdict.score)
            else NO_DECISION
        )

    def calls(self, verdict: Verdict) -> bool:
        """Return whether this rule calls a verdict stiction."""
        return self.verdict_of(verdict) == STICTION


def cells_of(S: np.ndarray, J: np.ndarray, called: np.ndarray) -> list[Cell]:
    """Return the share called sticky in every cell (S, J) of the sticky replicates."""
    keys = sorted({(round(j / s, 6), s, j) for s, j in zip(S, J) if s > 0})
    out = []
    for _, s, j in keys:
        here = called[(s == S) & (j == J)]
        lo, hi = wilson(here.sum(), here.size)
        out.append(Cell(float(s), float(j), float(here.mean()), float(lo), float(hi), here.size))
    return out


def smallest_visible(cells: Sequence[Cell]) -> tuple[float, float] | None:
    """Return the smallest S, with its J, from which on the sensitivity reaches `POWER`."""
    best = None
    for ratio in sorted({round(c.J / c.S, 6) for c in cells}):
        line = sorted((c for c in cells if round(c.J / c.S, 6) == ratio), key=lambda c: c.S)
        grown = scipy.optimize.isotonic_regression([c.share for c in line]).x
        if grown[-1] < POWER:
            continue
        first = int(np.argmax(grown >= POWER))
        S = line[first].S
        if first > 0:
            a, b = grown[first - 1], grown[first]
            S = float(np.exp(np.interp(POWER, [a, b], np.log([line[first - 1].S, S]))))
        if best is None or S < best[0]:
            best = (S, ratio * S)
    return best


def range_of_visible(cells: Sequence[Cell], seed: int) -> tuple[float, float]:
    """Return the 90 % interval of the S that `smallest_visible` gives, inf where it gives none.

    Shares are drawn from Jeffreys' posterior: what other replicates might have shown.
    """
    rng, found = np.random.default_rng([seed, 47]), []
    called = np.array([c.share * c.n for c in cells])
    missed = np.array([c.n for c in cells]) - called
    for shares in rng.beta(called + 0.5, missed + 0.5, (_DRAWS, len(cells))):
        drawn = [replace(c, share=float(x)) for c, x in zip(cells, shares, strict=True)]
        found.append((smallest_visible(drawn) or (np.inf,))[0])
    lo, hi = np.quantile(found, [0.05, 0.95], method="nearest")
    return float(lo), float(hi)


def cannot_tell_apart(one: Rule, other: Rule, sticky: np.ndarray) -> bool:
    """Return whether the 95 % interval of the difference between two rules' accuracies on the same
    replicates reaches 0.
    """
    difference = one.hits.astype(float) - other.hits
    # one replicate more that each alone answers right: few never show a difference exactly
    sides = [np.append(difference[kind], [-1.0, 1.0]) for kind in (sticky, ~sticky)]
    variance = sum(0.25 * float(d.var()) / d.size for d in sides)
    return abs(one.right - other.right) <= _Z * variance**0.5


def readings(method: str, verdicts: Sequence[Verdict], sticky: np.ndarray) -> list[Rule]:
    """Return the readings of a method here: its published rule, and a threshold on its score
    that healthy replicates set.
    """
    said = np.array([v.verdict for v in verdicts])
    hits = said == np.where(sticky, STICTION, NO_STICTION)
    published = Rule(method, None, _share_right(hits, sticky), hits)
    # what could not be scored is no alarm, and no finding either
    scores = np.array([v.score if v.score == v.score else -np.inf for v in verdicts])
    cut = _cut(scores[~sticky])
    if not np.isfinite(cut):
        return [published]
    hits, half = np.empty(sticky.size, dtype=bool), np.arange(sticky.size) % 2 == 0
    for here in (half, ~half):
        hits[here] = (scores[here] > _cut(scores[~here & ~sticky])) == sticky[here]
    chosen = Rule(method, cut, _share_right(hits, sticky), hits)
    return [chosen, published] if chosen.right > published.right + _BETTER else [published, chosen]


def _share_right(hits: np.ndarray, sticky: np.ndarray) -> float:
    return 0.5 * (float(hits[sticky].mean()) + float(hits[~sticky].mean()))


def _cut(healthy: np.ndarray) -> float:
    return float(np.quantile(healthy, 1.0 - _ALARMS, method="higher"))


def likelihood_ratio(verdict: str, verdicts: Sequence[str], sticky: np.ndarray) -> float:
    """Return how much more often sticky replicates get this verdict than healthy ones; half a
    replicate is added to each count.
    """
    same = np.array([v == verdict for v in verdicts])
    return float(
        ((same[sticky].sum() + 0.5) / (sticky.sum() + 1.5))
        / ((same[~sticky].sum() + 0.5) / ((~sticky).sum() + 1.5))
    )
