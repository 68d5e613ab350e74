"""Recognise detuning: a PI law explains OP exactly, but with other settings than the baseline's."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.effects._smallest import Probe


def smallest(probe: Probe) -> tuple[float, str] | None:
    """Return the factor from which the tuning counts as another one; only where the law is
    known.
    """
    return (1.14, "factor") if probe.situation.law.known else None


RECOGNISER = Recogniser(
    proven=lambda s: (
        None if s.law.tuning is None else dict(zip(("Kc_factor", "Ti_factor"), s.law.tuning))
    ),
    needs=frozenset({"tuning"}),
    smallest=smallest,
)
