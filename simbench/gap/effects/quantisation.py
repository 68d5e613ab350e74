"""Recognise quantised PV: every sample is a multiple of one step."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.situation import Situation


def proven(s: Situation) -> Parameters | None:
    """Return step and place of PV's lattice."""
    if s.archive.rounding is None:
        return None
    return {"step": s.archive.rounding[0], "at": s.archive.rounding[1]}


RECOGNISER = Recogniser(
    proven=proven,
    # an identified loop has the lattice of the record that it is identified from
    needs=frozenset({"plant"}),
)
