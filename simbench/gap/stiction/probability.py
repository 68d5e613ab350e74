"""Turn the likelihood evidence of one record into a probability of stiction, with weights fitted to
simulated loops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION

# learned by `python -m results.studies.plant.stiction_probability FOLDER -n 100 --seed 79` on loops
# of three simulators and of a grid whose sound loops are echoes, before the regression was
# mended where PV's past knows OP; today it prints 0.37, 1.09, 0.59, -0.79
_OFFSET, _WEIGHTS = 0.41, (1.09, 0.61, -0.79)
# nats that a regression may take away: noise, or a set point that moves, may hide a valve from it
# (AUC on loops of `refinery` in `results/stiction_probability.txt`: .79 without, .85 with it)
LEAST_REGRESSED = -5.0
_NATS = 20.0  # up to which a gain counts in full
# of the log-odds against stiction, that count: of 69 loops of which less than .20 was said 18 stuck
# (`results.studies.plant.denials`, seeds 77 and 78)
_SPARED = 0.7
_NARROW = 0.02  # share of OP's range below which a band is none
_CYCLES = (6.0, 33.0)  # between which their number counts
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
    """What one record shows of friction.

    `gain` (nats) of friction over whatever else may explain the record, its numbers paid for;
    `share` the fitted band over OP's range; `cycles` of the record, in each of which friction would
    have shown.
    """

    gain: float
    share: float = 1.0
    cycles: float = 10.0


def regressors(e: FrictionEvidence) -> tuple[float, float, float]:
    """Return what friction gains, and the logarithms of the share of OP's range that its band spans
    and of the cycles in which it would have shown.

    Beyond a few tens of nats a gain counts by its logarithm only: a model's errors grow with it. A
    narrow band speaks against friction: the record would have shown a wide one.
    """
    return (
        math.asinh(e.gain / _NATS),
        math.log(min(max(e.share, _NARROW), 1.0)),
        math.log(min(max(e.cycles, _CYCLES[0]), _CYCLES[1]) / 10.0),
    )


def log_odds(e: FrictionEvidence) -> float:
    """Return the log-odds of stiction, even odds before looking; at most the nats gained."""
    odds = _OFFSET + sum(weight * x for weight, x in zip(_WEIGHTS, regressors(e)))
    odds = min(odds, max(e.gain, 0.0))
    return odds if odds > 0.0 else _SPARED * odds


def pooled(odds: Sequence[float]) -> float:
    """Return the log-odds from several records of one loop, whose errors are largely the same."""
    return sum(odds) / (1.0 + SHARED * (len(odds) - 1))


def probability(odds: float) -> float:
    """Return the probability of log-odds, within what the loops learned on can show."""
    return min(max(0.5 * (1.0 + math.tanh(0.5 * odds)), 1.0 - EDGE), EDGE)


def verdict(p: float, yes: float = CLAIMED_FROM, no: float = DENIED_BELOW) -> str:
    """Return what a probability of stiction means: yes, no, or cannot tell."""
    return STICTION if p > yes else NO_STICTION if p < no else NO_DECISION
