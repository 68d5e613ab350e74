"""Limit the conclusions from a record whose baseline was identified from the same record to those
that the record alone supports.
"""

from __future__ import annotations

from dataclasses import replace

from simbench.gap.decide.assess import Assessment
from simbench.gap.effects import recogniser
from simbench.gap.intake.identify import meaningful
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS, block_of


def plausible(assessment: Assessment, sticky: bool | None = True) -> Assessment:
    """Keep of an assessment without trusted baseline what the record alone can carry.

    Effects that are defined relative to a plant are dropped, and those relative to a tuning unless
    it was given. Friction is chosen only if the valve is `sticky`, and ignored if that is open
    (None). Notes state what the samples show.
    """
    s = assessment.situation
    kept = meaningful(s.record.mv is not None, s.tuned)
    if sticky is None:
        kept -= {e for e in kept if recogniser(e).band is not None}
    gains = {
        e: (g if e in kept else min(g, -10.0)) for e, g in assessment.log_likelihood_gains.items()
    }
    possible = [e for e in gains if gains[e] > 0 and (sticky or recogniser(e).band is None)]
    chosen = [e for e in assessment.chosen if e in s.proven and gains[e] > 0][:2]
    for e in sorted((e for e in possible if e not in s.proven), key=lambda e: -gains[e]):
        if len(chosen) < 2 and block_of(e) not in {block_of(c) for c in chosen}:
            chosen.append(e)
    fits = [e for e in chosen if e in assessment.candidates]
    final = assessment.candidates[fits[0]].fit if fits else assessment.base
    noted = replace(s, notes=[*s.notes, *remarks(s)])
    return replace(
        assessment, situation=noted, log_likelihood_gains=gains, chosen=chosen, final=final
    )


def remarks(situation: Situation) -> list[str]:
    """Return, as "name: evidence", what record and samples show besides the effects: plant type
    assumed, lattices, outliers.
    """
    out = []
    if situation.record.process is None:
        kind = "integrating" if situation.integrating else "self-regulating"
        said = f", and a {situation.record.kind} may be either" if situation.record.kind else ""
        out.append(f"process: not given{said}; judged as {kind}, the likelier of the two")
    return out + [f"{e}: {remark}" for e in EFFECTS if (remark := recogniser(e).remark(situation))]
