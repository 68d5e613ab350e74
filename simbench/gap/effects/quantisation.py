"""Recognise quantised PV: every sample is a multiple of one step."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.effects._smallest import Probe
from simbench.gap.situation import Situation


def proven(s: Situation) -> Parameters | None:
    """Return step and place of PV's lattice."""
    return (
        None
        if s.archive.rounding is None
        else {"step": s.archive.rounding[0], "at": s.archive.rounding[1]}
    )


def smallest(probe: Probe) -> tuple[float, str]:
    """Return a step well above the digits PV is written in."""
    return max(
        20.0 * probe.situation.samples.resolution, 1e-6 * float(np.ptp(probe.engine.data.y))
    ), "PV units"


RECOGNISER = Recogniser(
    proven=proven,
    # an identified loop has the lattice of the record that it is identified from
    needs=frozenset({"plant"}),
    smallest=smallest,
)
