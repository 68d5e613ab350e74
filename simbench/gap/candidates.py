"""The results of all effects fitted to one record: which are possible, certain, probable or
indistinguishable, and which size of each could have been seen.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from simbench.gap.effects import Parameters, Recogniser, recogniser
from simbench.gap.effects._smallest import Probe
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, size_penalty
from simbench.gap.situation import Situation
from simbench.loop.effects import BLOCKS, EFFECTS, block_of
from simbench.loop.effects._alike import circumstances, indistinguishable
from simbench.loop.plant import first_order_like

# upper limit (nats) on the gain of an effect that an ordinary load could imitate: any other effect
# that explains as much is named first
LAST = 11.0
# nats behind the best, beyond which an effect is not fitted again on top of a richer base: on 78
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


def possible_effects(s: Situation, by_mv: bool | None = None) -> list[str]:
    """Return the effects whose fit makes sense for this baseline and these signals; `by_mv`: MV is
    known, here or in a test.
    """
    by_mv = s.record.mv is not None if by_mv is None else by_mv
    fitted = [
        e
        for e in EFFECTS
        if recogniser(e).fit is not None and not (by_mv and block_of(e) == "valve")
    ]
    return [e for e in fitted if recogniser(e).possible(s)]


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
        gain = _brought(engine, base, fit) - size_penalty(
            engine.data.n, count + engine.more_numbers(fit.spec, base.spec)
        )
        out[effect] = Candidate(effect, fit, gain, fit is not base)
    return out


def _brought(engine: Engine, base: Fit, fit: Fit) -> float:
    """Return the nats of a fit over the base; what the size of innovations alone tells counts by
    their tails (White 1982).

    Rare large innovations, as shots, steps or heavy-tailed noise leave, make a variance uncertain,
    and no signal: without this one of 79 real records, which has wild samples, gets an answer that
    leaves a wider gap; of 326 simulated ones none changes.
    """
    nats = fit.loglik - base.loglik
    if nats <= 0.0 or not (fit.spec.walk or fit.spec.load_walk or "noise_std" in fit.spec.free):
        return nats
    x = np.asarray(fit.residual)[kernels.SKIP :]
    tails = 0.5 * (float(np.mean(x**4) / np.mean(x**2) ** 2) - 1.0)
    by_size = (
        engine.evaluate(replace(fit.spec, channels=base.spec.channels), fit.theta) - base.loglik
    )
    return nats if tails <= 1.0 or by_size <= 0.0 else nats - by_size * (1.0 - 1.0 / tails)


def with_ordinary_load(
    engine: Engine, base: Fit, candidates: dict[str, Candidate], stated: Collection[str] = ()
) -> tuple[Fit, dict[str, Candidate]]:
    """Allow to every candidate what the load may do by itself and the effects that the baseline
    states; return the base and the candidates, gains over the new base.
    """
    n = engine.main(base).residual.size
    allowed = [e for e in candidates if e in stated or recogniser(e).ordinary is not None]
    allowed.sort(key=lambda e: (e not in stated, -candidates[e].log_likelihood_gain))
    for effect in allowed:
        one, ordinary = candidates[effect], recogniser(effect).ordinary
        if not one.used or one.log_likelihood_gain <= 0.0:
            continue
        plain = effect in stated or ordinary is None or ordinary(one.fit, base, engine.data, n)
        if plain is None:
            continue
        out = _on_top_of(
            engine,
            one.fit,
            one.log_likelihood_gain,
            {e: c for e, c in candidates.items() if e != effect},
        )
        gain = 0.0 if plain else min(one.log_likelihood_gain, LAST)
        base = one.fit
        candidates = {e: out.get(e, replace(one, log_likelihood_gain=gain)) for e in candidates}
    return base, candidates


def _on_top_of(
    engine: Engine, base: Fit, brought: float, candidates: dict[str, Candidate]
) -> dict[str, Candidate]:
    """Return the likelier of the two fits of each: as it was, less what the new base brought
    (nats), or on top of that base.
    """
    best = max((c.log_likelihood_gain for c in candidates.values()), default=0.0)
    again = fit_candidates(
        engine,
        base,
        [e for e, c in candidates.items() if c.log_likelihood_gain > best - _NEAR],
    )
    alone = {
        e: replace(c, log_likelihood_gain=c.log_likelihood_gain - brought)
        for e, c in candidates.items()
    }
    return {
        e: max(again.get(e, c), c, key=lambda c: c.log_likelihood_gain) for e, c in alone.items()
    }


def alike(effect: str, s: Situation, p: Mapping[str, float | str] | None = None) -> tuple[str, ...]:
    """Return the effects that give the same SP, OP and PV (and MV where recorded) as one here,
    itself included.
    """
    plant, r = first_order_like(s.baseline.plant).model_dump(), s.record
    here = circumstances(plant, s.baseline.noise.std, r.sp, s.op, np.asarray(r.pv), r.mv, effect, p)
    return tuple(
        sorted(
            e
            for e in indistinguishable(effect, here)
            if e == effect or recogniser(e) != Recogniser()
        )
    )


def smallest_detectable(
    s: Situation, base: Fit, longest_load: float, effects: Iterable[str] = EFFECTS
) -> dict[str, tuple[float, str]]:
    """Return the size of each effect that would have shown, with its unit."""
    probe = Probe(Engine(s.data, longest_load), base, s)
    sizes = {e: recogniser(e).smallest(probe) for e in effects}
    return {e: size for e, size in sizes.items() if size is not None}
