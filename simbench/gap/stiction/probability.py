"""Turn the likelihood evidence of one record into a probability of stiction, with weights fitted to
simulated loops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.special import logit

from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.gap.thresholds import (
    CLAIMED_FROM,
    DENIED_BELOW,
    EDGE,
    EXPLAINS,
    FEW_CYCLES,
    FULL_NATS,
    HARDLY_SEEN,
    MANY_CYCLES,
    NARROW,
    OFFSET,
    PER_BAND,
    PER_CYCLES,
    PER_GAIN,
    POOLED,
    SEEN,
    SEEN_CYCLES,
    SEEN_PACE,
)

_CLAIMED = float(logit(CLAIMED_FROM))


@dataclass(frozen=True)
class FrictionEvidence:
    """What one record shows of friction.

    `gain` (nats) of friction over whatever else may explain the record, its numbers paid for;
    `share` the fitted band over OP's range; `cycles` of the record, in each of which friction would
    have shown; `pace` the samples per period of an oscillation, 0 of a record that has none.
    """

    gain: float
    share: float = 1.0
    cycles: float = 10.0
    pace: float = 0.0

    @property
    def seen(self) -> bool:
        """Whether friction would have shown plainly: in many cycles, with enough samples in each,
        and where it does not explain much all the same.
        """
        often = self.cycles >= SEEN_CYCLES and self.pace >= SEEN_PACE
        return often and self.gain < EXPLAINS


def regressors(e: FrictionEvidence) -> tuple[float, float, float]:
    """Return what friction gains, and the logarithms of the share of OP's range that its band spans
    and of the cycles in which it would have shown.

    Beyond a few tens of nats a gain counts by its logarithm only: a model's errors grow with it. A
    narrow band speaks against friction: the record would have shown a wide one.
    """
    return (
        math.asinh(e.gain / FULL_NATS),
        math.log(min(max(e.share, NARROW), 1.0)),
        math.log(min(max(e.cycles, FEW_CYCLES), MANY_CYCLES) / 10.0),
    )


def log_odds(e: FrictionEvidence, seen: float = SEEN, hardly: float = HARDLY_SEEN) -> float:
    """Return the log-odds of stiction, even odds before looking; at most the nats gained.

    What is learned of claims overstates the odds of what is not claimed: the less so, the less
    friction would have shown. `seen` and `hardly` are the factors on how far these lie below.
    """
    odds = OFFSET + sum(
        weight * x for weight, x in zip((PER_GAIN, PER_BAND, PER_CYCLES), regressors(e))
    )
    most = max(e.gain, 0.0)
    odds = min(odds, most)
    factor = seen if e.seen else hardly
    return min(odds + (factor - 1.0) * min(odds - _CLAIMED, 0.0), most)


def pool_log_odds(odds: Sequence[float]) -> float:
    """Return the log-odds from several records of one loop, whose errors are largely the same."""
    return sum(odds) / (1.0 + POOLED * (len(odds) - 1))


def probability(odds: float) -> float:
    """Return the probability of log-odds, within what the loops learned on can show."""
    return min(max(0.5 * (1.0 + math.tanh(0.5 * odds)), 1.0 - EDGE), EDGE)


def verdict(p: float, yes: float = CLAIMED_FROM, no: float = DENIED_BELOW) -> str:
    """Return what a probability of stiction means: yes, no, or cannot tell."""
    if p > yes:
        return STICTION
    if p < no:
        return NO_STICTION
    return NO_DECISION
