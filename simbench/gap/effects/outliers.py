"""Recognise outliers: samples off the line through their neighbours."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.effects._smallest import Probe
from simbench.gap.likelihood import kernels
from simbench.gap.situation import Situation

_FAR = 4.0  # standard deviations of the innovations that a spike must exceed


def proven(s: Situation) -> Parameters | None:
    """Return the spikes that single samples show."""
    return None if s.archive.spikes is None else dict(zip(("rate", "size", "at"), s.archive.spikes))


def smallest(probe: Probe) -> tuple[float, str]:
    """Return the height that exceeds the innovations."""
    spread = float(np.sqrt(np.mean(probe.base.residual[kernels.SKIP :] ** 2)))
    return _FAR * spread * probe.base.theta["noise_std"], "PV units"


RECOGNISER = Recogniser(
    proven=proven,
    smallest=smallest,
)
