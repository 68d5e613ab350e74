"""Weights of the diagnosis procedure: which index of which detector counts, and how much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.verdict import Verdict


@dataclass(frozen=True)
class IndexWeight:
    """How one index of one method counts."""

    # method, index: where the number comes from; index "score" is the method's score
    method: str
    index: str
    weight: float  # log-odds per unit of the index
    neutral: float  # value that speaks for neither side; also used where the method abstains
    # low, high: the index is limited to this range
    low: float
    high: float

    def count(self, verdict: Verdict) -> float:
        """Return the index, limited to its range, less its neutral value; 0 where the method did
        not give it.
        """
        if self.index == "score":
            value = verdict.score
        else:
            value = verdict.indices.get(self.index, np.nan)
        if np.isfinite(value):
            return min(max(value, self.low), self.high) - self.neutral
        return 0.0


# Fitted to 1958 oscillating loops (grids chapter-2 and plant-2, another seed than theirs) by
# `python -m results.studies.procedure_weights --seed 111`: log-odds on these grids, elsewhere a
# score and no probability.
BIAS = {False: -0.1, True: -0.65}
EVIDENCE: dict[bool, tuple[IndexWeight, ...]] = {
    False: (
        IndexWeight("hammerstein", "gain", 5.15, 0.2, 0.0, 1.0),
        IndexWeight("hammerstein", "share", 1.45, 0.5, 0.0, 1.2),
        IndexWeight("he", "eta", 3.2, 0.5, 0.0, 1.0),
    ),
    True: (
        IndexWeight("hammerstein", "gain", 3.85, 0.2, 0.0, 1.0),
        IndexWeight("hammerstein", "share", 0.4, 0.5, 0.0, 1.2),
        IndexWeight("hammerstein", "error", -1.55, 0.3, 0.0, 1.0),
        IndexWeight("horch_histogram", "score", 5.4, 0.5, 0.0, 1.0),
    ),
}
# Asked as well and reported, without a weight.
WITNESSES = {
    False: ("rossi_scali", "singhal_salsbury", "horch", "srinivasan", "yamashita"),
    True: ("he", "rossi_scali", "srinivasan"),
}
# Who votes where the procedure counts heads, as its source does: the detectors it names for either
# process type.
VOTERS = {
    False: ("horch", "he", "rossi_scali", "singhal_salsbury"),
    True: ("horch_histogram", "he", "hammerstein"),
}
