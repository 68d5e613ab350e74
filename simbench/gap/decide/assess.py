"""Fit all effects to one record, collect the evidence of every source as rows, and test what the
best model leaves.

The steps stand in `assess`: fit every effect (`_fit_effects`), read the rows off
(`_evidence_rows`), choose one effect or two (`_choose_effects`), and ask what the best model
leaves (`left_over`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import expit

from simbench.gap.candidates import (
    Candidate,
    Fitted,
    fit_beside_load,
    fit_candidates,
    meaningful,
    possible_effects,
)
from simbench.gap.decide.left_over import Left, left_over
from simbench.gap.decide.posterior import ALONE, LAW, MV, PV, SAMPLES, Evidence, known_by, nats_of
from simbench.gap.decide.recorded_mv import Maps, by_op, by_stem, valve_maps
from simbench.gap.effects import NOT_IN_PLANT, Parameters, is_friction, recogniser
from simbench.gap.intake.other_loop import refuse_other_plant
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation, load_memory
from simbench.gap.thresholds import (
    BY_MV,
    EDGE,
    LEAST_NATS,
    LIKELIER,
    SECOND_NATS,
    TEMPERATURE,
    TERM_NATS,
)
from simbench.loop.effects import NONE, block_of

NOISE_EFFECT = "noise"


@dataclass(frozen=True, eq=False)
class Assessment(Fitted):
    """What one record shows of every effect."""

    rows: tuple[Evidence, ...] = ()
    # nats that effects of another block bring on top of the first one chosen, and of its rival
    on_top: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    tests: tuple[Left, ...] = ()  # what the residual tests of `final` say
    mv_unexplained: bool = False  # MV strays from OP as no map makes it
    valve_seen: bool = False  # MV was recorded
    # of the loop's other records, judged together with this one
    other_records: tuple[Assessment, ...] = ()
    # probability of friction where it is weighed apart: in an identified loop
    friction: float | None = None

    @property
    def first(self) -> str:
        """The strongest effect, before `none` and `unknown` are weighed."""
        if self.chosen:
            return self.chosen[0]
        return NONE

    @property
    def friction_alone(self) -> float:
        """Probability of friction by OP and PV without the loop file; a half where not asked."""
        nats = max((row.nats for row in self.rows if row.source == ALONE), default=0.0)
        return float(expit(TEMPERATURE * nats))

    @property
    def unknowns(self) -> list[Left]:
        """What speaks for something unknown in every record."""
        unknown = []
        for record in (self,) + self.other_records:
            for one in unknowns_of(record):
                unknown.append(one)
        return unknown

    @property
    def worst_test(self) -> tuple[float, str]:
        """The largest probability that something is unknown, and its block."""
        worst = max(self.unknowns, key=lambda one: one.probability, default=Left(0.0, NONE, ""))
        return worst.probability, worst.block

    @property
    def unexplained(self) -> dict[str, str]:
        """The blocks in which something no known effect explains, each with its first reason."""
        out: dict[str, str] = {}
        for one in self.unknowns:
            if one.probability > LIKELIER:
                out.setdefault(one.block, one.message)
        return out


def assess(
    situation: Situation, friction: float | None = None, alone: float = 0.0, seed: int = 0
) -> Assessment:
    """Fit and score every effect; `friction` is its probability where it is weighed apart, in an
    identified loop, `alone` its log-odds by OP and PV without the loop file, and `seed` that of the
    simulations beside which the best model is tested.
    """
    if situation.trusted and situation.tuned:
        refuse_other_plant(situation)

    # what MV shows, and every effect fitted to PV
    maps, mv_strays = valve_maps(situation)
    engine, bare, maps = _fit_model(situation, maps)
    s = _add_proven(situation, engine, bool(maps))
    fits = _fit_effects(s, engine, bare, bool(maps))
    parameters = _numbers_of_effects(s, fits, maps)

    # one effect or two, by the evidence of every source
    rows = _evidence_rows(s, fits.candidates, maps, parameters, alone)
    chosen, final, on_top = _choose_effects(s, rows, engine, fits.base, fits.candidates, friction)
    if len(chosen) == 2 and chosen[1] in fits.candidates:
        parameters[chosen[1]] = recogniser(chosen[1]).numbers(final, s)

    # what the best model leaves: jumps of the load take up those of PV, and what a mismatch leaves
    # looks like some; of an identified plant none is asked whether it is whole
    loaded = any(block_of(e) == "disturbance" for e in chosen)
    tests: tuple[Left, ...] = ()
    if situation.trusted:
        inside = {}
        for e in chosen:
            if e in parameters and e not in known_by(rows):
                inside[e] = parameters[e]
        brought = [nats_of(rows).get(e, 0.0) for e in chosen[:1]]
        brought += [on_top[chosen[0]][e] for e in chosen[1:]]
        explained = max(sum(brought), LEAST_NATS)
        fit_of_shifts = fits.base if loaded else final
        tests = left_over(s, (final, fit_of_shifts), inside, explained, seed)
    return Assessment(
        situation=replace(s, data=situation.data),
        base=fits.base,
        candidates=fits.candidates | fits.plain,
        parameters=parameters,
        chosen=chosen,
        final=final,
        rows=tuple(rows),
        on_top=on_top,
        tests=tests,
        mv_unexplained=mv_strays,
        valve_seen=bool(maps),
        friction=friction,
    )


@dataclass(frozen=True)
class _EffectFits:
    """Every effect fitted over `base`, which holds the load that the record shows as any loop may
    show one: `candidates` are the effects whose evidence counts, `plain` those of any loop.
    """

    base: Fit
    candidates: dict[str, Candidate]
    plain: dict[str, Candidate]


def _fit_effects(s: Situation, engine: Engine, bare: Fit, by_mv: bool) -> _EffectFits:
    """Fit every possible effect: beside an ordinary load, where one explains the record better than
    none.
    """
    candidates = fit_candidates(engine, bare, possible_effects(s, by_mv))
    plain, candidates = _split_candidates(candidates, _effects_of_any_loop(s, candidates))
    load = max(plain.values(), key=lambda c: c.log_likelihood_gain, default=None)
    if load is None or load.log_likelihood_gain <= 0.0:
        return _EffectFits(bare, candidates, plain)
    # what an ordinary load does by itself is in every model
    candidates = fit_beside_load(engine, load, candidates)
    more = _effects_of_any_loop(s, candidates)
    beside, candidates = _split_candidates(candidates, more)
    return _EffectFits(load.fit, candidates, plain | beside)


def _numbers_of_effects(s: Situation, fits: _EffectFits, maps: Maps) -> dict[str, Parameters]:
    """Return the parameters of every effect that PV, MV, the law or samples show."""
    every = fits.candidates | fits.plain
    numbers = {e: recogniser(e).numbers(c.fit, s) for e, c in every.items() if c.used}
    return numbers | {**s.proven, **{e: p for e, (_, p) in maps.items()}}


def _fit_model(s: Situation, maps: Maps) -> tuple[Engine, Fit, Maps]:
    """Return the engine, its fit without effect, and what MV says.

    Of what a baseline's plant may have in it already, MV shows that it is there, and PV whether the
    simulation lacks it: the plant then answers MV, and otherwise OP, as the baseline says.
    """
    engine = _make_engine(s, maps)
    base = engine.base()
    if not maps or not s.trusted:
        return engine, base, maps
    seen = max(maps, key=lambda e: maps[e][0])
    nats, p = maps[seen]
    if NOT_IN_PLANT not in recogniser(seen).needs or nats <= BY_MV:
        return engine, base, maps
    given = _make_engine(by_op(s), {})
    without = given.base()
    more = base.loglik - without.loglik

    # what else MV could be is less likely than this
    maps = {e: (n - nats, q) for e, (n, q) in maps.items()} | {seen: (min(nats, more), p)}
    if more > 0.0:
        return (engine, base, maps)
    return (given, without, maps)


def _make_engine(s: Situation, maps: Maps) -> Engine:
    """Return the engine of a record."""
    return Engine(by_stem(s, maps), load_memory(s))


def _add_proven(s: Situation, engine: Engine, by_mv: bool) -> Situation:
    """Return the situation with the engine's data, and what law or samples show that has a meaning
    beside this baseline.
    """
    known = {}
    for e, p in s.proven.items():
        if meaningful(e, s.trusted, s.tuned, by_mv):
            known[e] = p
    return replace(s, data=engine.data, proven=known)


def _effects_of_any_loop(s: Situation, candidates: Mapping[str, Candidate]) -> list[str]:
    """Return the effects that show what any loop does by itself, or that the baseline states."""
    ordinary = []
    for e, c in candidates.items():
        if c.used and (e in s.stated or recogniser(e).ordinary(c.fit, s)):
            ordinary.append(e)
    return ordinary


def _split_candidates(
    candidates: Mapping[str, Candidate], names: Collection[str]
) -> tuple[dict[str, Candidate], dict[str, Candidate]]:
    """Return the candidates of some names, and the others."""
    return (
        {e: c for e, c in candidates.items() if e in names},
        {e: c for e, c in candidates.items() if e not in names},
    )


def _evidence_rows(
    s: Situation,
    candidates: Mapping[str, Candidate],
    maps: Maps,
    parameters: Mapping,
    alone: float,
) -> list[Evidence]:
    """Return what law, samples, MV, PV, and OP and PV without a model show, each effect's rows with
    its numbers; what the baseline states has none.
    """
    # What law and samples prove
    rows = []
    for e, p in s.proven.items():
        rows.append(Evidence(e, LAW if block_of(e) == "controller" else SAMPLES, TERM_NATS, p))

    # The position by MV, and PV's likelihood
    seen = {}
    for e, (gain, _) in maps.items():
        seen[e] = (MV, gain)
    seen |= {e: (PV, float(c.log_likelihood_gain)) for e, c in candidates.items()}
    for e, (source, nats) in seen.items():
        if e not in s.proven and e not in s.stated:
            rows.append(Evidence(e, source, nats, parameters.get(e, {})))

    # Friction as OP and PV show it without any model
    without_model = alone / TEMPERATURE
    by_pv = []
    for row in rows:
        if row.source == PV and is_friction(row.effect):
            by_pv.append(row)
    return rows + [replace(row, source=ALONE, nats=without_model) for row in by_pv if alone]


def _choose_effects(
    s: Situation,
    rows: Sequence[Evidence],
    engine: Engine,
    base: Fit,
    candidates: Mapping[str, Candidate],
    friction: float | None,
) -> tuple[list[str], Fit, dict[str, dict[str, float]]]:
    """Return the one or two effects that the evidence asks for, the fit with them, and the nats
    that effects of another block bring on top of the first, and of a rival of friction.

    What law or samples show comes first, unless friction, whose probability is asked by itself, is
    likelier than not.
    """
    # the strongest effect
    known = known_by(rows)
    nats = nats_of(rows)
    allowed = []
    for e in nats:
        if friction is None or is_friction(e) == (friction > LIKELIER):
            allowed.append(e)
    first = max(allowed, key=lambda e: nats[e], default=NONE)
    if known and not (friction is not None and is_friction(first)):
        first = known[0]
    elif first == NONE or (nats[first] <= 0.0 and not is_friction(first)):
        return [], base, {}

    # another one beside it
    fits, brought = _on_top_of(first, s, rows, engine, candidates, friction)
    on_top = {first: brought}
    if first in candidates:
        final = candidates[first].fit
    else:
        final = base
    more = [e for e in brought if brought[e] > SECOND_NATS]
    second = max(more, key=lambda e: brought[e], default=NONE)
    if second in fits or second in candidates:
        final = (fits or candidates)[second].fit

    # a load whose jumps follow the slips of a valve may need friction beside it as well
    rival = max((e for e in nats if not is_friction(e)), key=lambda e: nats[e], default=NONE)
    close = nats.get(rival, -np.inf) > nats[first] - SECOND_NATS
    if friction is None and is_friction(first) and not known and close:
        on_top[rival] = _on_top_of(rival, s, rows, engine, candidates, friction)[1]
    return [first, second] if more else [first], final, on_top


def _on_top_of(
    first: str,
    s: Situation,
    rows: Sequence[Evidence],
    engine: Engine,
    candidates: Mapping[str, Candidate],
    friction: float | None,
) -> tuple[dict[str, Candidate], dict[str, float]]:
    """Return the fits of effects of another block beside a first one, and the nats that they bring
    on top of it.
    """
    # effects of another block, of which friction may be weighed apart
    nats = nats_of(rows)
    others = []
    for e in nats:
        if block_of(e) != block_of(first):
            others.append(e)
    if friction is not None:
        others = [e for e in others if not is_friction(e)]

    # their fits beside the first, but of what any loop does by itself
    fits: dict[str, Candidate] = {}
    if first in candidates:
        final = candidates[first].fit
        fits = fit_candidates(engine, final, [e for e in others if e in candidates])
        plain = _effects_of_any_loop(s, fits)
        others = [e for e in others if e not in plain]

    # what they bring; what OP and PV say by themselves holds beside the first effect, too
    brought = {}
    for e in others:
        if e in fits:
            brought[e] = float(fits[e].log_likelihood_gain)
        else:
            brought[e] = nats[e]
    for row in rows:
        if row.source == ALONE and row.effect in fits and row.effect in brought:
            brought[row.effect] += row.nats
    return fits, brought


def unknowns_of(assessment: Assessment) -> list[Left]:
    """Return what speaks for something unknown in one record: what needs no statistics, and the
    tests of its best model.
    """
    s = assessment.situation
    if s.unexplained_law:
        facts = [("controller", s.unexplained_law)]
    else:
        facts = []
    if s.frozen and s.trusted and "frozen_sensor" not in s.proven:
        facts.append(("sensor", f"PV does not change for {s.samples.held} samples"))
    if assessment.mv_unexplained:
        facts.append(("valve", "MV strays from OP as no known valve makes it"))
    return [Left(float(EDGE), block, why) for block, why in facts] + list(assessment.tests)
