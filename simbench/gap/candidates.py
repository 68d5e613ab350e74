"""The results of all effects fitted to one record: which are possible, certain, probable or
indistinguishable, and which size of each could have been seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from simbench.gap.effects import Parameters, Recogniser, recogniser
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, size_penalty
from simbench.gap.situation import Situation
from simbench.loop.effects import BLOCKS, EFFECTS, block_of
from simbench.loop.effects._alike import circumstances, indistinguishable
from simbench.loop.plant import first_order_like
from simbench.loop.resolve import friction

# nats behind the best, beyond which an effect is not fitted again beside an ordinary load: on 78
# records no answer changes
_NEAR = 40.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted effect: its gain over the base in log-likelihood (nats), after the penalty for its
    parameters; `used` is False when nothing was switched on.
    """

    effect: str
    fit: Fit
    log_likelihood_gain: float
    used: bool = True


@dataclass(frozen=True, eq=False)
class Fitted:
    """Effects fitted to one record.

    `base` is the fit without effect, `candidates` those with one each, `parameters` the effects'
    numbers in the units of the loop file, `chosen` the effects named (none, one or two, strongest
    first), `final` the fit with all of them.
    """

    situation: Situation
    base: Fit
    candidates: dict[str, Candidate]
    parameters: dict[str, Parameters]
    chosen: list[str]
    final: Fit


def meaningful(effect: str, trusted: bool, tuned: bool, by_mv: bool) -> bool:
    """Return whether an effect can be judged with what is known: a plant that was identified lacks
    none of its numbers, and a tuning neither; MV shows the valve whatever the plant.
    """
    known = {name for name, given in (("plant", trusted), ("tuning", tuned)) if given}
    lacks = (recogniser(effect).needs & {"plant", "tuning"}) - known
    return not lacks or (by_mv and block_of(effect) == "valve")


def possible_effects(s: Situation, by_mv: bool | None = None) -> list[str]:
    """Return the effects whose fit makes sense for this baseline and these signals; `by_mv`: MV is
    known, here or in a test.
    """
    # What the baseline has, that some effects need
    if by_mv is None:
        by_mv = s.record.mv is not None
    has = {"time constant": not s.integrating, "valve without friction": not friction(s.baseline)}
    effects = []

    # Effects that can be told from these signals
    for e in EFFECTS:
        if (
            recogniser(e).fit is not None
            and not (by_mv and block_of(e) == "valve")
            and meaningful(e, s.trusted, s.tuned, by_mv)
            and all(has.get(need, True) for need in recogniser(e).needs)
        ):
            effects.append(e)
    return effects


def proven(s: Situation) -> dict[str, Parameters]:
    """Return the effects that the controller's law or single samples show without doubt, with their
    parameters.
    """
    missing = [e for e in EFFECTS if e not in s.stated]
    parameters = {
        e: recogniser(e).proven(s) for e in sorted(missing, key=lambda e: BLOCKS.index(block_of(e)))
    }
    return {e: p for e, p in parameters.items() if p is not None}


def fit_candidates(engine: Engine, base: Fit, effects: Iterable[str]) -> dict[str, Candidate]:
    """Fit each effect on top of a base and return it with its penalised gain in nats."""
    out = {}
    for effect in effects:
        try_it = recogniser(effect).fit
        assert try_it is not None, effect
        fit, count = try_it(engine, base)
        gain = fit.loglik - base.loglik - size_penalty(engine.data.n, count)
        out[effect] = Candidate(effect, fit, gain, fit is not base)
    return out


def fit_beside_load(
    engine: Engine, load: Candidate, candidates: Mapping[str, Candidate]
) -> dict[str, Candidate]:
    """Return candidates beside what an ordinary load does by itself, their gains over it: the
    likelier of the fit as it was, less what the load brings, and one on top of the load's.
    """
    best = max((c.log_likelihood_gain for c in candidates.values()), default=0.0)
    near = [e for e, c in candidates.items() if c.log_likelihood_gain > best - _NEAR]
    again = fit_candidates(engine, load.fit, near)
    less: dict[str, Candidate] = {}
    for e, c in candidates.items():
        less[e] = replace(c, log_likelihood_gain=c.log_likelihood_gain - load.log_likelihood_gain)
    return {
        e: max(again.get(e, c), c, key=lambda c: c.log_likelihood_gain) for e, c in less.items()
    }


def find_look_alikes(
    effect: str, s: Situation, p: Mapping[str, float | str] | None = None
) -> tuple[str, ...]:
    """Return the effects that give the same SP, OP and PV (and MV where recorded) as one here,
    itself included.
    """
    plant = first_order_like(s.baseline.plant).model_dump()
    r = s.record
    here = circumstances(plant, s.baseline.noise.std, r.sp, s.op, np.asarray(r.pv), r.mv, effect, p)
    alike = []
    for e in indistinguishable(effect, here):
        if e == effect or recogniser(e) != Recogniser():
            alike.append(e)
    return tuple(sorted(alike))
