"""Recognise quantised OP: OP takes only multiples of a step, which its law does not explain."""

from __future__ import annotations

from simbench.detectors.signal.lattice import hides_nothing
from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.situation import Situation

_CARD = 0.025  # % of OP: what any output card of 12 bits rounds to


def proven(s: Situation) -> Parameters | None:
    """Tell a lattice of OP from an output card's and from one that changes nothing."""
    step = s.law.step
    if step > _CARD and not hides_nothing(step, s.op):
        return {"step": step}
    return None


RECOGNISER = Recogniser(
    proven=proven,
)
