"""What can be said of a record whose baseline was identified from it: only what the record alone can carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.gap.decide.assess import FAINT, Assessment
from simbench.gap.effects import recogniser
from simbench.gap.intake.identify import meaningful
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import NUISANCES
from simbench.gap.situation import Situation
from simbench.loop.effects import EFFECTS, block_of

SHARE = 0.15  # of the OP range that a band must span to count as friction


def plausible(found: Assessment) -> Assessment:
    """Keep of an assessment without trusted baseline what the record alone can carry.

    Parameters
    ----------
    found : Assessment

    Returns
    -------
    Assessment
        Effects that compare with a plant are dropped, and with a tuning, unless that was given; friction must span a share of
        the OP range and be found in both halves of the record. What MV shows of the valve needs no baseline and stays. Notes
        say what the samples show.
    """
    s = found.situation
    seen = s.record.mv is not None
    kept = meaningful(seen, s.tuned)
    gains = {e: (g if e in kept else min(g, -10.0)) for e, g in found.log_likelihood_gains.items()}
    span = float(np.quantile(s.op, 0.99) - np.quantile(s.op, 0.01))
    for effect in EFFECTS:
        how, p = recogniser(effect), found.parameters.get(effect)
        if how.band is not None and gains[effect] > 0 and not seen:
            narrow = p is None or how.band(p) < SHARE * span
            if narrow or not in_both_halves(found, effect):
                gains[effect] = FAINT
    order = sorted((e for e in gains if gains[e] > 0 and e not in s.proven), key=lambda e: -gains[e])
    chosen = [e for e in found.chosen if e in s.proven and gains[e] > 0][:2]
    for e in order:
        if len(chosen) < 2 and block_of(e) not in {block_of(c) for c in chosen}:
            chosen.append(e)
    fits = [e for e in chosen if e in found.candidates]
    final = found.candidates[fits[0]].fit if fits else found.base
    said = replace(s, notes=[*s.notes, *remarks(s)])
    return replace(found, situation=said, log_likelihood_gains=gains, chosen=chosen, final=final)


def remarks(situation: Situation) -> list[str]:
    """Return, as "name: evidence", what record and samples show beside the effects.

    Parameters
    ----------
    situation : Situation

    Returns
    -------
    list of str
        `process`: which plant type was assumed; `quantisation`, `op_quantisation`, `outliers`: how many, how large.
    """
    out = []
    if situation.record.process is None:
        kind = "integrating" if situation.integrating else "self-regulating"
        out.append(f"process: not given; judged as {kind}, the likelier of the two")
    return out + [f"{e}: {said}" for e in EFFECTS if (said := recogniser(e).remark(situation))]


def in_both_halves(found: Assessment, effect: str) -> bool:
    """Return whether friction explains each half of the record better than none, its numbers held.

    Parameters
    ----------
    found : Assessment
    effect : str
        Stiction or dead-band.

    Returns
    -------
    bool
    """
    d = found.situation.data
    fit = found.candidates[effect].fit if effect in found.candidates else None
    if fit is None:
        return False
    half = d.n // 2
    for cut in (slice(0, half), slice(half, d.n)):
        part = replace(d, u=np.ascontiguousarray(d.u[cut]), y=np.ascontiguousarray(d.y[cut]))
        engine = Engine(part, max(0.1 * half, 5.0))
        theta = dict(fit.theta)
        spec = replace(fit.spec, channels=())
        # where in its band the valve stands at the cut is anybody's guess
        tries = [engine.fit(replace(spec, start=begin), theta, search=NUISANCES, steps=8) for begin in (-1.0, 0.0, 1.0)]
        # the same plant and load are free on both sides
        without = engine.fit(replace(found.base.spec, channels=()), {**found.base.theta, **theta}, steps=8)
        if max(t.loglik for t in tries) < without.loglik:
            return False
    return True
