"""Recognise an error dead-band: OP does not change while, and only while, the error is small."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.effects._smallest import Probe


def smallest(probe: Probe) -> tuple[float, str] | None:
    """Return a width that a fifth of the errors stays within; only where the law is known."""
    s = probe.situation
    if not s.law.known:
        return None
    return 2.0 * float(np.quantile(np.abs(s.sp - np.asarray(s.record.pv)), 0.2)), "PV units"


RECOGNISER = Recogniser(
    proven=lambda s: {"width": s.law.gap} if s.law.gap > 0.0 else None,
    smallest=smallest,
)
