"""Fit and score all effects on one record, and test the residuals; what no effect explains leads to
the answer "unknown".

The steps stand in `assess`: fit every effect (`_fitted`), let the load be richer
(`with_ordinary_load`), score (`_scores`), choose one or two (`_choose_effects`), and test what the
best model does not explain (`tests_of`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from simbench.gap.candidates import (
    LAST,
    Candidate,
    Fitted,
    fit_candidates,
    possible_effects,
    with_ordinary_load,
)
from simbench.gap.decide.beside_tests import (
    Maps,
    by_stem,
    joint_engine,
    lab_gains,
    valve_maps,
)
from simbench.gap.effects import NOT_TRIED, Parameters, recogniser
from simbench.gap.intake.other_loop import refuse_other_plant
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.residual_tests import tests_of
from simbench.gap.situation import ModelledTest, Situation, load_memory
from simbench.gap.thresholds import (
    BURSTS_LIMIT,
    FACT,
    GUESSED,
    INPUT_LIMIT,
    LEAST_NATS,
    MEMORY_LIMIT,
    MORE_NOISE,
    SECOND_NATS,
)
from simbench.loop.effects import EFFECTS, NONE, block_of

SURE = 1000.0  # nats that stand for evidence needing no statistics
NOISE_EFFECT = "noise"


@dataclass(frozen=True, eq=False)
class Assessment(Fitted):
    """Scores of one record.

    `log_likelihood_gains` are nats over "no effect" for every effect that could be tried; `chosen`
    holds before `none` and `unknown` are weighed; `tests` are the residual statistics of `final`;
    `mv_unexplained` whether MV strays as no map makes it; `valve_seen` whether MV was recorded,
    here or in a test; `other_records` the assessments of the loop's other records, judged together
    with this one; `stiction` its probability under an identified baseline, None where it cannot be
    judged; `asked` the tests of the menu that were run; `by_lab` the nats of lab samples in
    `log_likelihood_gains`; `ordinary` the loads (% of travel) and the noise (factor of the stated
    one) that are more than the baseline states, and no more than any loop has, by effect.
    """

    log_likelihood_gains: dict[str, float] = field(default_factory=dict)
    tests: dict[str, float] = field(default_factory=dict)
    log_likelihood_gains_on_top: dict[str, float] = field(default_factory=dict)
    mv_unexplained: bool = False
    valve_seen: bool = False
    other_records: tuple[Assessment, ...] = ()
    stiction: float | None = None
    asked: tuple[str, ...] = ()
    by_lab: dict[str, float] = field(default_factory=dict)
    ordinary: dict[str, float] = field(default_factory=dict)

    def shown(self, effect: str) -> bool:
        """Whether single samples, the controller's law, MV or lab samples show an effect, and no
        likelihood of PV is needed.
        """
        seen = self.valve_seen and recogniser(effect).by_mv is not None
        return seen or effect in self.situation.proven or self.by_lab.get(effect, 0.0) > LEAST_NATS

    @property
    def failures(self) -> list[tuple[float, str, str]]:
        """Every test of every record as (times its limit, block, message)."""
        return [test for one in (self, *self.other_records) for test in failures(one)]

    @property
    def worst_test(self) -> tuple[float, str]:
        """By how many times its limit the best model fails a test, at worst, and in which block."""
        ratio, block, _ = max(self.failures, default=(0.0, NONE, ""))
        return ratio, block

    @property
    def unexplained(self) -> dict[str, str]:
        """The blocks in which something no known effect explains, each with its first reason."""
        out: dict[str, str] = {}
        for ratio, block, message in self.failures:
            if ratio > 1.0:
                out.setdefault(block, message)
        return out


def assess(situation: Situation, tests: Sequence[ModelledTest] = ()) -> Assessment:
    """Fit and score every effect, to a record alone or to one and its tests as one model."""
    if situation.trusted and situation.tuned:
        refuse_other_plant(situation)
    record = situation
    situation, maps, engine, base, candidates = _fitted(situation, tests)
    ordinary = _ordinary(situation, engine, base, candidates)
    base, candidates = with_ordinary_load(engine, base, candidates, _stated(situation))
    gains, parameters = _scores(situation, base, engine.main(base), candidates, maps[0])
    by_lab = lab_gains(tests, base, parameters, gains)
    gains = capped({e: gain + by_lab.get(e, 0.0) for e, gain in gains.items()}) | dict.fromkeys(
        situation.proven, SURE
    )
    chosen, final, on_top = _choose_effects(situation, engine, base, candidates, gains)
    if len(chosen) == 2 and on_top and chosen[1] in candidates:
        parameters[chosen[1]] = recogniser(chosen[1]).numbers(final, situation)
    # the limits are those of one record, and what a plant of higher order does not explain adds up
    # over several
    left = {name: value / (1 + len(tests)) for name, value in tests_of(engine, final).items()}
    fits = (base, final, *(c.fit for c in candidates.values()))
    alone = {id(f): engine.main(f) for f in fits}
    candidates = {e: replace(c, fit=alone[id(c.fit)]) for e, c in candidates.items()}
    situation = replace(situation, data=record.data)
    fitted = (situation, alone[id(base)], candidates, parameters, chosen, alone[id(final)])
    return Assessment(
        *fitted,
        gains,
        left,
        on_top,
        maps[1],
        bool(maps[0]),
        by_lab=by_lab,
        ordinary=ordinary,
    )


def _ordinary(
    s: Situation, engine: Engine, base: Fit, candidates: dict[str, Candidate]
) -> dict[str, float]:
    """Return the loads that explain the record better than none, and noise beyond the stated one,
    each with its size, that are ordinary of a loop of which no healthy record is given.
    """
    if s.data.measured or not s.trusted:
        return {}
    n, out = engine.main(base).residual.size, {}
    for effect in candidates.keys() - _stated(s):
        one, about = candidates[effect], recogniser(effect)
        if about.travel is None or one.log_likelihood_gain <= LEAST_NATS:
            continue
        p = about.numbers(one.fit, s)
        if about.masked(s, p) or (about.ordinary and about.ordinary(one.fit, base, engine.data, n)):
            out[effect] = about.travel(p, s.record.duration)
    stated = float(np.hypot(s.data.noise, s.data.resolution / np.sqrt(12.0)))
    if s.data.noise > 0.0 and base.theta["noise_std"] > MORE_NOISE * stated:
        out[NOISE_EFFECT] = base.theta["noise_std"] / stated
    return out


def _stated(s: Situation) -> frozenset[str]:
    """Return the effects that the baseline states, or what does the same to PV."""
    like = {e for e in EFFECTS if recogniser(e).is_load_on_pv} if s.loads_on_pv else set()
    return s.stated | like


def _choose_effects(
    s: Situation,
    engine: Engine,
    base: Fit,
    candidates: dict[str, Candidate],
    gains: dict[str, float],
) -> tuple[list[str], Fit, dict[str, float]]:
    """Return the one or two effects that the evidence asks for, the fit with them, and the nats
    that others bring on top of the first.
    """
    chosen = sorted(s.proven, key=lambda e: -gains[e])[:2]
    order = sorted((e for e in gains if e not in s.proven), key=lambda e: -gains[e])
    final, on_top = base, {}
    if len(chosen) < 2:
        best = next((e for e in order if block_of(e) not in {block_of(c) for c in chosen}), None)
        if best is not None and gains[best] > (
            _least_nats_of_second(chosen[0], s, best) if chosen else 0.0
        ):
            chosen.append(best)
            final = candidates[best].fit if best in candidates else base
    if len(chosen) == 1:
        others = [e for e in order if block_of(e) not in map(block_of, chosen)]
        on_top = _gains_on_top(s, engine, final, others, gains, candidates)
        runner = max(on_top, key=lambda e: on_top[e], default=None)
        if runner is not None and on_top[runner] > _least_nats_of_second(chosen[0], s, runner):
            chosen.append(runner)
            if runner in candidates:
                final = fit_candidates(engine, final, [runner])[runner].fit
    return chosen, final, on_top


def _fitted(
    s: Situation, tests: Sequence[ModelledTest]
) -> tuple[Situation, tuple[Maps, bool], Engine, Fit, dict[str, Candidate]]:
    """Return the situation with the engine's data, what MV says, the engine, its base and every
    effect fitted on top.
    """
    maps = valve_maps(s, tests)
    if tests:
        engine: Engine = joint_engine(s, tests, maps[0])
    else:
        data = by_stem(s, s.data, s.op, s.record.Ts, s.record.mv, maps[0])
        engine = Engine(data, load_memory(s))
    shown = {e: p for t in tests for e, p in t.proven.items()}
    s = replace(s, data=engine.data, proven={**shown, **s.proven})
    base = engine.base()
    by_mv = s.record.mv is not None or any(t.mv is not None for t in tests)
    return s, maps, engine, base, fit_candidates(engine, base, possible_effects(s, by_mv))


def _scores(
    s: Situation, base: Fit, alone: Fit, candidates: dict[str, Candidate], maps: Maps
) -> tuple[dict[str, float], dict[str, Parameters]]:
    """Return every effect's gain (nats) and parameters; `alone` is the base as the record alone has
    it.
    """
    gains = {e: float(c.log_likelihood_gain) for e, c in candidates.items()}
    parameters = {e: recogniser(e).numbers(c.fit, s) for e, c in candidates.items() if c.used}
    for effect in EFFECTS:
        gains.setdefault(effect, NOT_TRIED)
    parameters |= s.proven
    for effect, (gain, p) in maps.items():
        gains[effect], parameters[effect] = gain, p
    stated = _stated(s)
    for effect in (e for e in EFFECTS if e not in s.proven):
        by_noise = recogniser(effect).by_innovations(alone, s)
        if by_noise is not None:
            gains[effect], parameters[effect] = by_noise
        masked = effect in parameters and recogniser(effect).masked(s, parameters[effect])
        if masked or effect in stated:
            gains[effect] = min(gains[effect], 0.0)
    return gains, parameters


def _least_nats_of_second(first: str, s: Situation, effect: str) -> float:
    """Return the nats asked of a second effect: those of a first one where OP alone proves the
    other and PV is whole; without this one of 79 real records gets an answer that leaves a wider
    gap.
    """
    by_op = first in s.proven and block_of(first) == "controller"
    return LEAST_NATS if by_op and block_of(effect) != "sensor" else SECOND_NATS


def _gains_on_top(
    s: Situation,
    engine: Engine,
    first: Fit,
    order: list[str],
    gains: dict[str, float],
    candidates: dict[str, Candidate],
) -> dict[str, float]:
    """Return what further effects bring on top of the first; what the engine does not see counts
    as it is.
    """
    tried = [
        e for e in order if e in candidates and (recogniser(e).ordinary is None or gains[e] > LAST)
    ]
    fitted = fit_candidates(engine, first, tried)
    return {e: float(c.log_likelihood_gain) for e, c in fitted.items()} | {
        e: gains[e] for e in order if e not in candidates
    }


# what the residual tests of whole models do not exceed (98 to 99 % of development records), and the
# block that fails beyond
RESIDUAL_LIMITS = {
    "memory": (MEMORY_LIMIT, "disturbance"),
    "input": (INPUT_LIMIT, "process"),
    "bursts": (BURSTS_LIMIT, "sensor"),
}


def failures(assessment: Assessment) -> list[tuple[float, str, str]]:
    """Return every test of one record as (times its limit, block, message)."""
    situation = assessment.situation
    out: list[tuple[float, str, str]] = []
    if situation.unexplained_law:
        out.append((FACT, "controller", situation.unexplained_law))
    claimed = {recogniser(e).explains for e in EFFECTS}
    out += [
        (FACT, block, f"{words}, as no known effect makes it")
        for fact, (block, words) in situation.facts.items()
        if fact not in claimed
    ]
    if situation.frozen and situation.trusted:
        out.append(
            (
                FACT,
                "sensor",
                f"PV does not change for {situation.samples.held} samples",
            )
        )
    if assessment.mv_unexplained:
        out.append((FACT, "valve", "MV strays from OP as no known valve makes it"))
    if not situation.trusted:
        # a residual test asks whether a model is whole; one whose plant was identified never is
        return out
    # of a valve that MV showed in a test alone the record's slips are guessed, and one missed
    # spoils all that follow
    guessed = assessment.valve_seen and situation.record.mv is None
    loose = guessed and any(recogniser(e).band is not None for e in assessment.chosen)
    for name, (limit, block) in RESIDUAL_LIMITS.items():
        limit *= GUESSED if loose else 1.0
        message = (
            f"the best model does not explain everything ({name}:"
            f" {assessment.tests[name]:.0f}, limit {limit:.0f})"
        )
        out.append((max(assessment.tests[name], 0.0) / limit, block, message))
    return out


def capped(gains: Mapping[str, float]) -> dict[str, float]:
    """Return gains below SURE, as no likelihood outranks what single samples prove; those near the
    best keep their distance.
    """
    over = max(max(gains.values(), default=0.0) - 0.9 * SURE, 0.0)
    return {e: min(gain, max(gain - over, 0.5 * SURE)) for e, gain in gains.items()}
