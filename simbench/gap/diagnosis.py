"""Diagnose one record against one loop file, from the check of the data to the report (`simbench
gap diagnose`).

The steps stand in `diagnose_all`: assess every record (`_assess_one`), simulate the closed loop
with each effect (`ClosedLoops`), weigh the effects (`classify`), and write the report (`report`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from joblib import Parallel, delayed

from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import ParameterError, RecordError, Refusal, UserError
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.sources import RecordSignals, as_record
from simbench.gap.candidates import find_look_alikes, smallest_detectable
from simbench.gap.closed_loop.gap import Shrinkage, within_reach
from simbench.gap.closed_loop.identified import IdentifiedLoops
from simbench.gap.closed_loop.remaining import Remaining, remaining
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import NOISE_EFFECT, Assessment, assess
from simbench.gap.decide.beside_tests import other_plants
from simbench.gap.decide.evidence import known_by
from simbench.gap.decide.posterior import Posterior, posterior
from simbench.gap.effects import is_friction
from simbench.gap.intake.beside_record import contradiction, model_test, refuse_twice
from simbench.gap.intake.check import check
from simbench.gap.intake.healthy import Healthy, check_healthy, learn
from simbench.gap.intake.partial import Partial, complete_baseline, read_baseline
from simbench.gap.intake.recorded_test import RecordedTest
from simbench.gap.intake.refuse import SAME_TS, refuse_unfit
from simbench.gap.planning.order import plan
from simbench.gap.report.result import DiagnosisDetails, Gap, GapReport, Ranked
from simbench.gap.situation import Situation, load_memory
from simbench.gap.stiction.altered import FRICTION
from simbench.gap.stiction.candidate_loops import CandidateLoops, candidate_loops
from simbench.gap.stiction.conclusion import (
    Conclusion,
    at_rest,
    from_posterior,
    from_record,
    judged,
    without,
)
from simbench.gap.stiction.friction import as_believed, refuse_unweighable, stands
from simbench.gap.stiction.probability import pool_log_odds
from simbench.gap.stiction.visible import visible_in
from simbench.gap.thresholds import DENIED_BELOW, LIKELIER, NEAR
from simbench.loop import resolve
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN, block_of
from simbench.safe_path import safe_path
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from simbench.detectors.sources import Source


def diagnose(
    record: Source | Sequence[Source] | None = None,
    baseline: Loop | Partial | str | Path | None = None,
    *,
    identify: bool = False,
    tests: Sequence[RecordedTest] = (),
    healthy: Sequence[Source] = (),
    jobs: int = 1,
    seed: int = 0,
    **signals: Unpack[RecordSignals],
) -> GapReport:
    """Say where a simulation differs from a record, which effect it lacks, and how far adding it
    closes the gap.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str, Path, or sequence of them
        SP, OP, PV and, where recorded, MV, as `simbench.detect` takes them. Several records of one
        loop are judged together.
    baseline : Loop, Partial, str, Path or None
        The simulation, or its loop file; None identifies plant and tuning from the record, a
        partial one what it does not say.
    identify : bool
        Identify plant and tuning from the record, as without a baseline; none can be given beside
        it.
    tests : sequence of RecordedTest
        Tests of the same loop in other operation, judged with the (longest) record as one model.
    healthy : sequence of LoopRecord, run, DataFrame, mapping, str or Path
        Records of the same loop, or of its siblings, from healthy operation: noise and loads that
        they show are ordinary, and larger ones are effects. They need a baseline with its plant.
    jobs : int
        Processes, where there are several records; -1 uses all cores.
    seed : int
        Root of every random stream.
    **signals
        op, pv, sp, mv, Ts in place of a record, and what is known of it, as in `simbench.detect`.

    Returns
    -------
    GapReport
        Effect, block and parameters that the simulation lacks, with probabilities and
        shrinkage of the gap.

    Raises
    ------
    simbench.detectors.errors.UserError
        In one sentence, when record and baseline cannot be compared.

    Examples
    --------
    >>> import simbench as sb
    >>> loop = sb.Loop(
    ...     plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     controller={"type": "PI", "Kc": 1, "Ti": 10},
    ...     sampling={"Ts": 1, "n": 1500},
    ...     noise={"std": 0.1},
    ...     setpoint={"steps": [[100, 55], [700, 48]]},
    ... )
    >>> diagnose(loop.with_("controller.Kc", 1.6).simulate(1).record, loop).effect
    'detuning'
    """
    if identify and baseline is not None:
        raise ParameterError("gap diagnose: a baseline and identify given; one of both is needed")
    records = _records(record, signals)
    if not records:
        raise RecordError("no record to diagnose")
    refuse_twice(tests)
    paces = sorted({r.Ts for r in records})
    if paces[-1] > (1.0 + SAME_TS) * paces[0]:
        raise RecordError(
            f"records judged together must have one Ts; it is {paces[0]:g} s in one and"
            f" {paces[-1]:g} s in another"
        )
    loop = _read_loop(baseline)
    return diagnose_all(records, loop, tests, jobs, seed, [as_record(one) for one in healthy])


def diagnose_all(
    records: list[LoopRecord],
    baseline: Loop | Partial | None,
    tests: Sequence[RecordedTest] = (),
    jobs: int = 1,
    seed: int = 0,
    healthy: Sequence[LoopRecord] = (),
) -> GapReport:
    """Return the report of `diagnose`, its records and baseline read."""
    said: list[str] = []
    if baseline is None:
        # what is identified from wild samples or a stopped archive is no loop; beside a loop file,
        # outliers and a frozen sensor are effects that are named
        given = records
        records = [repair_record(one) for one in records]
        said = [n for old, new in zip(given, records) for n in new.notes if n not in old.notes]
    # thousands of tiny matrices: threads would only wait for each other
    with one_thread():
        controls = [check_healthy(one, baseline) for one in healthy]
        ordinary = learn(controls) if controls else None
        said += [note for one in controls if (note := _not_healthy(one))]
        assessment, loops = _assess_all(records, baseline, jobs, tests, ordinary)
        kind = ClosedLoops if assessment.situation.stated_parts else IdentifiedLoops
        found = report(assessment, weigh_evidence(assessment), kind(assessment, seed), loops)
    return replace(found, notes=(*found.notes, *said))


def conclude(
    record: Source | Sequence[Source] | None = None,
    loop: Loop | Partial | str | Path | None = None,
    *,
    tests: Sequence[RecordedTest] = (),
    **signals: Unpack[RecordSignals],
) -> Conclusion:
    """Say whether a valve sticks, from all evidence at hand; every verb shows this conclusion.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str, Path, or sequence of them
        SP, OP, PV and, where recorded, MV, as `simbench.detect` takes them.
    loop : Loop, Partial, str, Path or None
        The loop, or its loop file, where it is known; friction is then weighed with every other
        effect that could explain the record.
    tests : sequence of RecordedTest
        Tests of the same loop in other operation; they need a loop.
    **signals
        op, pv, sp, mv, Ts in place of a record, and what is known of it, as in `simbench.detect`.

    Returns
    -------
    Conclusion
        verdict, probability, cause, reason, next.

    Raises
    ------
    simbench.detectors.errors.UserError
        In one sentence, when record and loop cannot be compared.

    Examples
    --------
    >>> from random_case import random_case
    >>> conclude(random_case(5, ("stiction",)).record).verdict
    'stiction'
    """
    records = _records(record, signals)
    if loop is None and len(records) == 1:
        return judged(records[0])[0]
    return diagnose_all(records, _read_loop(loop), tests).conclusion


def _read_loop(loop: Loop | Partial | str | Path | None) -> Loop | Partial | None:
    """Return a loop, read from its file where a path is given."""
    return read_baseline(loop) if isinstance(loop, (str, Path)) else loop


def _records(given: Any, signals: Any) -> list[LoopRecord]:
    """Return one record or several as a list."""
    several = isinstance(given, Sequence) and not isinstance(given, str)
    return [as_record(one, **signals) for one in (given if several else [given])]


def _assess_one(
    record: LoopRecord,
    baseline: Loop | Partial | None,
    tests: Sequence[RecordedTest] = (),
    ordinary: Healthy | None = None,
) -> tuple[Assessment, CandidateLoops | Refusal | None]:
    """Return the assessment of one record, with its tests, and the loops that may have made
    it, or why it is not weighed; None where that is not asked.

    With a trusted baseline friction is weighed with all other effects: no loops are needed then.
    """
    # 1. the record and the baseline: can they be compared, and what does the baseline not say?
    refuse_unfit(record, f"record {record.tag!r}" if record.tag else "record")
    record, of_mv = as_believed(record)
    loop, given, completions = complete_baseline(record, baseline)
    completions = [*completions, *of_mv]
    if ordinary is not None:
        completions = [*completions, ordinary.note(loop, record.duration)]
        loop = ordinary.stated_in(loop, record.Ts)
    # 2. what the record shows without any likelihood
    situation = check(record, loop, trusted="plant" in given, tuned="controller" in given)
    situation = replace(situation, notes=[*situation.notes, *completions])
    if ordinary is not None:
        situation = ordinary.ordinary_in(situation)
    # 3. with an identified baseline: does friction explain the record better than other loops?
    loops: CandidateLoops | Refusal | None = None
    friction = None
    try:
        refuse_unweighable(record)
        if not situation.trusted:
            loops = candidate_loops(record, baseline)
            friction = loops.probability
    except UserError as why:
        loops = Refusal(str(why))
        situation.notes.append(f"{FRICTION}: cannot tell, {why}")
        friction = None if situation.trusted else 0.0
    # 4. every effect fitted and scored, with the tests of the same loop
    return assess_with_tests(situation, tests, friction), loops


def assess_with_tests(
    situation: Situation, tests: Sequence[RecordedTest], friction: float | None = None
) -> Assessment:
    """Assess a record with those of its tests that nothing contradicts; the others are noted and
    not counted.
    """
    kept = []
    notes = []
    contrary = "test: {} contradicts the record and is not counted: {}"
    for test in tests:
        one = model_test(test, situation)
        reason = contradiction(test, one, situation)
        if reason:
            notes.append(contrary.format(one.name, reason))
        else:
            kept.append(one)
            if test.id == "raw" and one.explained:
                # what the archive hides of PV, or stores at another time, is no other controller
                situation = replace(situation, unexplained_law="")
    assessment = assess(situation, kept, friction)
    others = (
        other_plants(assessment, assessment.situation, kept) if kept and situation.trusted else []
    )
    for one, reason in [pair for pair in zip(kept, others) if pair[1]]:
        notes.append(contrary.format(one.name, f"{reason}; the loop of {one.name} is another"))
        kept.remove(one)
    if any(others):
        assessment = assess(situation, kept, friction)
    if kept:
        names = ", ".join(one.name for one in kept)
        notes.append(f"tests: {names} judged with the record as one model")
    assessment.situation.notes.extend(notes)
    return replace(assessment, asked=tuple(t.id for t in tests))


def _not_healthy(s: Situation) -> str:
    """Return what a record that is called healthy shows besides load and noise; "" for nothing."""
    found = assess(s)
    effect = found.first
    if effect in (NONE, NOISE_EFFECT) or block_of(effect) == "disturbance":
        return ""
    return (
        f"healthy: {s.record.tag or 'a record'} shows {effect.replace('_', ' ')} itself"
        f" (probability {weigh_evidence(found).probability[effect]:.2f}); only its load and noise"
        " are taken from it"
    )


def _assess_all(
    records: list[LoopRecord],
    baseline: Loop | Partial | None,
    jobs: int,
    tests: Sequence[RecordedTest] = (),
    ordinary: Healthy | None = None,
) -> tuple[Assessment, CandidateLoops | Refusal | None]:
    """Assess every record; evidence adds up, and the longest record carries the tests, the fits,
    parameters and the gap.
    """
    longest, *shorter = sorted(records, key=lambda r: -r.n)
    assessed = delayed(_assess_one)
    calls = [
        assessed(longest, baseline, tests, ordinary),
        *(assessed(r, baseline, ordinary=ordinary) for r in shorter),
    ]
    with safe_path():
        pairs: list[Any] = list(Parallel(n_jobs=jobs if shorter else 1)(calls))
    every = [assessment for assessment, _ in pairs]
    loops = pairs[0][1]
    main, *others = every
    weighed = [one for _, one in pairs if isinstance(one, CandidateLoops)]
    if weighed:
        loops = replace(weighed[0], log_odds=pool_log_odds([one.log_odds for one in weighed]))
        main = replace(main, friction=loops.probability)
    if not others:
        return main, loops
    main.situation.notes.append(
        f"{len(every)} records judged together; gap and parameters are those of"
        f" {main.situation.record.tag or 'the longest'}"
    )
    main = replace(
        main,
        rows=tuple(row for one in every for row in one.rows),
        parameters={e: p for f in reversed(every) for e, p in f.parameters.items()},
        chosen=main.chosen or max((f.chosen for f in every), key=len),
        other_records=tuple(others),
    )
    return main, loops


def weigh_evidence(found: Assessment) -> Posterior:
    """Return the posterior of an assessment's evidence."""
    return posterior(found.rows, found.first, found.on_top, found.worst_test, found.friction)


def name_effects(weights: Posterior, assessment: Assessment) -> list[str]:
    """Return the answer: the most probable, and the other effect that was chosen with it."""
    first = weights.first
    chosen = assessment.chosen
    return [first, *(e for e in chosen if first in chosen and e != first)]


def report(
    assessment: Assessment,
    weights: Posterior,
    runs: ClosedLoops,
    loops: CandidateLoops | Refusal | None = None,
) -> GapReport:
    """Turn evidence and simulations into the answer."""
    s = assessment.situation
    weights = _with_gap(assessment, weights, runs)
    shown = None
    stated = s.trusted and bool(resolve.friction(s.baseline))
    if s.trusted and loops is None and not stated and weights.friction < DENIED_BELOW:
        shown = visible_in(assessment)
        if shown.open:
            weights = weights.with_friction(DENIED_BELOW)
    weights, main, left = _beside_simulations(assessment, weights, runs)
    unseen = not assessment.valve_seen or assessment.mv_unexplained
    if s.trusted and (stated or (weights.first == UNKNOWN and unseen)):
        # what is not known may be friction, where no MV shows the valve, and a valve whose friction
        # is stated is not sound
        weights = weights.with_friction(max(weights.friction, DENIED_BELOW))
    otherwise = None
    if s.trusted and weights.first == UNKNOWN:
        otherwise = runs.as_shown(weights.block(UNKNOWN))
    if otherwise is not None:
        main = otherwise[1]
        left = remaining(s, main.features)
    named = name_effects(weights, assessment)
    lines = {line.effect: line for line in _ranking(assessment, weights, runs, main, named)}
    planned = plan(assessment, weights.probability, runs, most=1)
    if stands(s.record):
        conclusion = at_rest(s.record)
    elif isinstance(loops, Refusal) and s.trusted:
        conclusion = without(loops.reason, named)
    elif loops is None:
        advice = planned.next_test
        test = None if advice is None else f"{advice['test']}: {advice['says']}"
        conclusion = from_posterior(weights, named, assessment, shown, test)
    else:
        conclusion = from_record(Prepared(replace(s.record, mv=None)), loops)[0]
    return GapReport(
        block=weights.block(named[0]),
        effect=named[0],
        effects=tuple(lines[e].as_answer() for e in named),
        group=lines[named[0]].group,
        ranking=tuple(lines.values()),
        gap=Gap(
            main.before,
            main.recalibrated,
            main.after,
            main.floor,
            main.resolvable,
            main.plant_floor,
        ),
        shrinkage=_shrinkage(main, named, otherwise is not None),
        remaining=left,
        blocks=weights.shares,
        next_test=planned.next_test,
        notes=tuple(_notes(assessment, lines, named, main, planned.why)),
        conclusion=replace(conclusion, notes=s.record.notes),
        # of friction the conclusion says what would have shown
        behind=DiagnosisDetails(
            assessment,
            runs,
            main,
            smallest_detectable(s, assessment.base, load_memory(s)),
            next(iter(planned.tests), None),
            None if otherwise is None else otherwise[0],
        ),
        op_unit=s.record.S_unit,
    )


def _beside_simulations(
    assessment: Assessment, weights: Posterior, runs: ClosedLoops
) -> tuple[Posterior, Shrinkage, tuple[Remaining, ...]]:
    """Return the posterior beside simulations with its answer, what they close, and what remains.

    An effect that is likelier than not, or that law or samples show, is named however far they are.
    """
    named = name_effects(weights, assessment)
    main = runs.shrink([e for e in named if e in EFFECTS])
    known = known_by(assessment.rows)
    if not known and _needs_none(weights, main):
        weights = weights.enough()
        main = runs.shrink([e for e in name_effects(weights, assessment) if e in EFFECTS])
    if not known and _lacks_unknown(weights, main):
        far = remaining(assessment.situation, main.features)
        block = far[0].block if far else "disturbance"
        weights = weights.far(main.after / (NEAR * main.plant_floor), block)
        main = runs.shrink([])
    return weights, main, remaining(assessment.situation, main.features)


def _needs_none(weights: Posterior, main: Shrinkage) -> bool:
    """Return whether the simulation without an effect is near the record, and no effect has a
    probability of which less is denied.
    """
    first = weights.first
    unlikely = first in EFFECTS and weights.probability[first] < DENIED_BELOW
    return unlikely and within_reach(main.before, main.plant_floor)


def _with_gap(assessment: Assessment, weights: Posterior, runs: ClosedLoops) -> Posterior:
    """Return the posterior in which the distance from a baseline that was given tells whether
    anything unknown is lacking.
    """
    apart = runs.gap_as_given(assessment.load) if assessment.situation.trusted else None
    return weights if apart is None else weights.parted(apart)


def _lacks_unknown(weights: Posterior, main: Shrinkage) -> bool:
    """Return whether something unknown is lacking: nothing is likelier than not, and the simulation
    stays far from the record, or the likeliest is friction that is denied.
    """
    first = weights.first
    if first == UNKNOWN or (first != NONE and weights.probability[first] > LIKELIER):
        return False
    denied = is_friction(first) and weights.friction < DENIED_BELOW
    return denied or not within_reach(main.after, main.plant_floor)


def _ranking(
    assessment: Assessment,
    weights: Posterior,
    runs: ClosedLoops,
    main: Shrinkage,
    named: Sequence[str],
) -> list[Ranked]:
    """Return every answer, the most probable first; the gap before and after of those that were
    simulated.
    """
    effects = [e for e in named if e in EFFECTS]
    ranking = sorted(weights.probability.items(), key=lambda kv: -kv[1])
    sizes = {NONE: (main.before, main.before)}
    if named[0] == UNKNOWN and main.after < min(main.before, main.recalibrated):
        sizes[UNKNOWN] = main.before, main.after
    if len(effects) == 1:
        sizes[effects[0]] = main.before, main.after
    for e, _ in ranking[:3]:
        if e in assessment.parameters and [e] != effects:
            rival = runs.rival([e], effects)
            if rival is not None:
                sizes[e] = rival.before, rival.after
    what = {e: "noise" if e == NOISE_EFFECT else "load" for e in assessment.ordinary}
    most: dict[str, float] = {}
    for e, size in assessment.ordinary.items():
        most[what[e]] = max(size, most.get(what[e], 0.0))
    return [
        Ranked(
            e,
            weights.block(e),
            float(p),
            *sizes.get(e, (None, None)),
            assessment.parameters.get(e, {}),
            _group(e, assessment),
            most if e == NONE else {},
        )
        for e, p in ranking
    ]


def _group(answer: str, assessment: Assessment) -> tuple[str, ...]:
    """Return the answers that the record cannot tell from one, itself among them: effects that are
    alike, and none where an effect is no larger than it may be by itself.
    """
    if answer == NONE:
        return NONE, *assessment.ordinary
    if answer == UNKNOWN:
        return (UNKNOWN,)
    same = find_look_alikes(answer, assessment.situation, assessment.parameters.get(answer))
    return (*same, NONE) if answer in assessment.ordinary else same


def _shrinkage(main: Shrinkage, named: Sequence[str], shown: bool) -> dict[str, float] | None:
    """Return the share of the gap that the named effects close, or (`shown`) a part of the
    loop as the record shows it; None where none is claimed.
    """
    if main.value is None or not (shown or named[0] in EFFECTS):
        return None
    return {"value": main.value, "lo": main.lo, "hi": main.hi}


def _notes(
    assessment: Assessment,
    lines: Mapping[str, Ranked],
    named: Sequence[str],
    main: Shrinkage,
    no_test: str,
) -> list[str]:
    """Return what else a reader must know, a sentence each."""
    s = assessment.situation
    notes = [*s.notes, *(f"{block}: {why}" for block, why in assessment.unexplained.items())]
    if named[0] == NONE and (note := lines[NONE].ordinary_note()):
        notes.insert(0, note)
    if no_test:
        notes.append(f"next test: none, {no_test}")
    if not main.resolvable and within_reach(main.after, main.plant_floor):
        notes.append(
            f"the gap ({main.before:.2f}) does not stand out of its floor ({main.floor:.2f}): no"
            " shrinkage is claimed"
        )
    if s.trusted and resolve.friction(s.baseline):
        notes.append(
            "the loop file's valve has friction: the probability of stiction is that of more"
            " friction than it states"
        )
    return notes
