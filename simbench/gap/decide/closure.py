"""Let the closed loop have its say: an answer whose simulations stay far from the record is not the
whole answer.
"""

from __future__ import annotations

from collections.abc import Sequence

from simbench.gap.closed_loop.gap import Shrinkage
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.classify import Classified, doubt
from simbench.gap.effects import recogniser
from simbench.gap.thresholds import NEAR
from simbench.loop.effects import NONE, UNKNOWN


def misfit(assessment: Assessment, effects: Sequence[str], closed: Shrinkage) -> float:
    """Return how many times the allowed distance simulations with the named effects are from the
    record, 0 where nothing speaks against the answer.

    An effect answers for the gap that it narrows, and one that single samples show beside a given
    plant needs no simulation. That no effect is needed is said of simulations near the record
    alone.
    """
    if effects and closed.lo > 0.0:
        return 0.0
    if effects and assessment.situation.trusted and assessment.shown(effects[0]):
        return 0.0
    ratio = closed.after / (NEAR * closed.plant_floor)
    return ratio if ratio > 1.0 else 0.0


def nothing_to_explain(assessment: Assessment, effects: Sequence[str], closed: Shrinkage) -> bool:
    """Return whether the simulation is as near to the record without effects as its own runs are to
    each other; what single samples show, and friction, need no gap.
    """
    if not effects or closed.before > closed.floor or assessment.shown(effects[0]):
        return False
    return recogniser(effects[0]).band is None


def with_nothing(weights: Classified) -> Classified:
    """Return the probabilities where there is nothing to explain: those of all effects but friction
    are those of none.
    """
    p = {
        e: v if e in (NONE, UNKNOWN) or recogniser(e).band is not None else 0.0
        for e, v in weights.probability.items()
    }
    return Classified({**p, NONE: p[NONE] + 1.0 - sum(p.values())}, weights.unknown_block)


def not_the_gap(effects: Sequence[str], closed: Shrinkage, bare: Shrinkage) -> str:
    """Return in words what effects explain that fit PV beside OP best and leave the gap open."""
    names = " and ".join(effect.replace("_", " ") for effect in effects)
    return (
        f"{names}: likeliest by PV's answer to OP, sample by sample, but not what the simulation"
        f" lacks: its gap is {closed.after:.2f} with it, {bare.after:.2f} without"
    )


def with_closure(weights: Classified, ratio: float, block: str) -> Classified:
    """Return the probabilities after the test of the closed loop failed by a ratio: `unknown` takes
    what a failed residual test gives it, all others keep their odds.
    """
    q = doubt(ratio)
    p = {e: (1.0 - q) * v for e, v in weights.probability.items()}
    return Classified({**p, UNKNOWN: p[UNKNOWN] + q}, block)
