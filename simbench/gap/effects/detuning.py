"""Recognise detuning: a PI law explains OP exactly, but with other settings than the baseline's."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser

RECOGNISER = Recogniser(
    proven=lambda s: (
        None if s.law.tuning is None else dict(zip(("Kc_factor", "Ti_factor"), s.law.tuning))
    ),
    needs=frozenset({"tuning"}),
)
