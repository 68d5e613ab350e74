"""Recognise outliers: samples off the line through their neighbours."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.situation import Situation


def proven(s: Situation) -> Parameters | None:
    """Return the spikes that single samples show."""
    if s.archive.spikes is None:
        return None
    return dict(zip(("rate", "size", "at"), s.archive.spikes))


RECOGNISER = Recogniser(
    proven=proven,
)
