"""Turn the likelihood evidence of one record into a probability of stiction, with weights fitted to
simulated loops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION

# learned by `python -m results.studies.plant.stiction_probability FOLDER -n 100 --seed 79` on loops
# of three simulators and of a grid whose sound loops are echoes
_OFFSET, _WEIGHT, _BAND = 0.43, 1.10, 0.38
# tens of nats between which evidence counts; beyond, a model's errors are larger
_BOUNDS = (-1.0, 3.0)
_NARROW = 0.02  # share of OP's range below which a band is none
# share of OP's range from which on a band counts in full: a valve that makes the loop cycle moves
# OP by S to 1.2 S
_WIDE = 0.5
EDGE = 0.99  # no probability is surer than the loops it was learned on can show
# An answer that is wrong costs five times as much as none, a repair for nothing as much as a valve
# that goes on sticking: then an answer pays from a posterior of 1 - 1/5 on (Chow 1970, IEEE Trans.
# Inf. Theory 16).
_NO_ANSWER = 0.2
CLAIMED_FROM, DENIED_BELOW = 1.0 - _NO_ANSWER, _NO_ANSWER
LIKELIER = 0.5  # above it friction is the more probable
STICKING_VALVES = 0.3  # share of a plant's valves that stick (Bialkowski 1993)
SHORTEST_ASKED = 60  # samples
SHARED = 0.75  # correlation of the log-odds of one loop's records, given the truth


@dataclass(frozen=True)
class FrictionEvidence:
    """What the likelihood of one record measured of friction.

    `gain` (nats) of friction over none, its numbers paid for; `outside` the gain of an oscillation
    from outside; `share` the fitted band over OP's range.
    """

    gain: float
    outside: float = 0.0
    share: float = 1.0


def regressors(e: FrictionEvidence) -> tuple[float, float]:
    """Return what speaks for friction, in tens of nats, and the logarithm of the share of OP's
    range that its band spans.

    What friction gains beyond an oscillation from outside counts by that share. A narrow band
    speaks against friction as well: the record would have shown a wide one.
    """
    nats = min(max((e.gain - max(e.outside, 0.0)) / 10.0, _BOUNDS[0]), _BOUNDS[1])
    shown = nats * (min(e.share / _WIDE, 1.0) if nats > 0.0 else 1.0)
    return shown, math.log(min(max(e.share, _NARROW), 1.0))


def log_odds(e: FrictionEvidence) -> float:
    """Return the log-odds of stiction, even odds before looking."""
    shown, band = regressors(e)
    return _OFFSET + _WEIGHT * shown + _BAND * band


def pooled(odds: Sequence[float]) -> float:
    """Return the log-odds from several records of one loop, whose errors are largely the same."""
    return sum(odds) / (1.0 + SHARED * (len(odds) - 1))


def probability(odds: float) -> float:
    """Return the probability of log-odds, within what the loops learned on can show."""
    return min(max(0.5 * (1.0 + math.tanh(0.5 * odds)), 1.0 - EDGE), EDGE)


def verdict(p: float, yes: float = CLAIMED_FROM, no: float = DENIED_BELOW) -> str:
    """Return what a probability of stiction means: yes, no, or cannot tell."""
    return STICTION if p > yes else NO_STICTION if p < no else NO_DECISION
