"""diagnose(): one record beside one loop file, from the check to the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from joblib import Parallel, delayed

from detectors.compiled import one_thread
from detectors.errors import RecordError, UserError
from detectors.prepared import Prepared
from detectors.record import LoopRecord
from detectors.sources import RecordSignals, as_record
from scenarios.spec import Loop
from simbench.gap.candidates import alike, smallest_detectable
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import RESIDUAL_LIMITS, SURE, Assessment, assess, capped
from simbench.gap.decide.beside_tests import other_plants
from simbench.gap.decide.classify import Classified, classify
from simbench.gap.decide.identified import plausible
from simbench.gap.discover.discovery import described
from simbench.gap.discover.search import search
from simbench.gap.effects import recogniser
from simbench.gap.intake.beside_record import contradiction, modelled, refuse_twice
from simbench.gap.intake.check import check
from simbench.gap.intake.partial import Partial, completed
from simbench.gap.intake.recorded_test import RecordedTest
from simbench.gap.intake.refuse import SAME_TS, refuse_unfit
from simbench.gap.plan.expected import plan
from simbench.gap.report.result import DiagnosisDetails, Gap, GapReport, Ranked
from simbench.gap.situation import Situation, load_memory
from simbench.gap.stiction.candidate_loops import CandidateLoops, candidate_loops
from simbench.gap.stiction.conclusion import (
    Conclusion,
    from_posterior,
    from_record,
    judged,
    without,
)
from simbench.gap.stiction.friction import FRICTION, refuse_unweighable, with_sound_valve
from simbench.gap.stiction.probability import DENIED_BELOW, pooled
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN, block_of

if TYPE_CHECKING:
    from detectors.sources import Source

_WIDE = 1.5  # floors, beyond which a gap is wide
# of the least noise that is believed, below which the model predicts PV to its digits: nothing is
# missing
_PREDICTED = 0.1
_EXPLANATIONS = 5  # that are simulated under each test, to say in passing which one to run next
_SETTLED = 0.9  # probability from which nobody asks for the log behind the archive
_QUICK_MENU = ("mv", "sp_steps", "bump", "stairs", "lab")


def diagnose(
    record: Source | Sequence[Source] | None = None,
    baseline: Loop | Partial | None = None,
    *,
    tests: Sequence[RecordedTest] = (),
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
    baseline : Loop, Partial or None
        The simulation; None identifies plant and tuning from the record, a partial one what it does
        not say.
    tests : sequence of RecordedTest
        Tests of the same loop in other operation, judged with the (longest) record as one model.
    jobs : int
        Processes, where there are several records; -1 uses all cores.
    seed : int
        Root of every random stream.
    **signals
        op, pv, sp, mv, Ts in place of a record, and what is known of it, as in `simbench.detect`.

    Returns
    -------
    GapReport

    Raises
    ------
    detectors.errors.UserError
        In one sentence, when record and baseline cannot be compared.

    Examples
    --------
    >>> import simbench as sb
    >>> told = sb.Loop(
    ...     plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     controller={"type": "PI", "Kc": 1, "Ti": 10},
    ...     sampling={"Ts": 1, "n": 1500}, noise={"std": 0.1},
    ...     setpoint={"steps": [[100, 55], [700, 48]]})
    >>> diagnose(told.with_("controller.Kc", 1.6).simulate(1).record, told).effect
    'detuning'
    """
    several: list[Any] = (
        list(record) if isinstance(record, Sequence) and not isinstance(record, str) else [record]
    )
    records = [as_record(one, **signals) for one in several]
    if not records:
        raise RecordError("no record to diagnose")
    refuse_twice(tests)
    paces = sorted({r.Ts for r in records})
    if paces[-1] > (1.0 + SAME_TS) * paces[0]:
        raise RecordError(
            f"records judged together must have one Ts; it is {paces[0]:g} s in one and"
            f" {paces[-1]:g} s in another"
        )
    return diagnose_all(records, baseline, tests, jobs, seed)


def diagnose_all(
    records: list[LoopRecord],
    baseline: Loop | Partial | None,
    tests: Sequence[RecordedTest] = (),
    jobs: int = 1,
    seed: int = 0,
    *,
    describe: bool = True,
) -> GapReport:
    """Return the report of `diagnose`; `describe` looks for a law of what is unknown, which changes
    no conclusion.
    """
    # thousands of tiny matrices: threads would only wait for each other
    with one_thread():
        found, behind, more = _assess_all(records, baseline, jobs, tests)
        runs = ClosedLoops(found, seed)
        judged_by, like = closing(classify(found), found, runs), None
        weights = judged_by
        if describe and named_by(weights, found) == [UNKNOWN]:
            like = described(
                found.situation,
                search(found.situation, held_out(found.situation)),
                lambda: found,
                seed,
            )
            if like.block:
                # a law that pays on unseen samples, or the best of all explanations, says where
                # better than a test that fails
                weights = replace(weights, unknown_block=like.block)
        out = replace(report(found, weights, runs, more, behind, judged_by), looks_like=like)
        if isinstance(baseline, Loop) and with_sound_valve(baseline) is not baseline:
            # what a simulation with friction does not model is not the friction that the valve has
            tested = [replace(t, loop=with_sound_valve(t.loop)) for t in tests]
            sound = diagnose_all(
                records, with_sound_valve(baseline), tested, jobs, seed, describe=False
            )
            return replace(out, conclusion=sound.conclusion)
        return out


def conclude(
    record: Source | Sequence[Source] | None = None,
    loop: Loop | Partial | None = None,
    *,
    tests: Sequence[RecordedTest] = (),
    **signals: Unpack[RecordSignals],
) -> Conclusion:
    """Say whether a valve sticks, from all evidence at hand; every verb shows this conclusion.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str, Path, or sequence of them
        SP, OP, PV and, where recorded, MV, as `simbench.detect` takes them.
    loop : Loop, Partial or None
        The loop where it is known; friction is then weighed with every other effect that could
        explain the record.
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
    detectors.errors.UserError
        In one sentence, when record and loop cannot be compared.

    Examples
    --------
    >>> from random_case import random_case
    >>> conclude(random_case(5, ("stiction",)).record).verdict
    'stiction'
    """
    if loop is None and (isinstance(record, str) or not isinstance(record, Sequence)):
        return judged(as_record(record, **signals))[0]
    several = (
        list(record) if isinstance(record, Sequence) and not isinstance(record, str) else [record]
    )
    return diagnose_all(
        [as_record(one, **signals) for one in several], loop, tests, describe=False
    ).conclusion


def _assess_one(
    record: LoopRecord, baseline: Loop | Partial | None, tests: Sequence[RecordedTest] = ()
) -> tuple[Assessment, CandidateLoops | str]:
    """Return the assessment of one record, with its tests, and the loops that may stand behind it,
    or why it is not weighed.

    Beside a trusted baseline friction is weighed with all other effects: no loops are needed then.
    """
    refuse_unfit(record, f"record {record.tag!r}" if record.tag else "record")
    loop, given, said = completed(record, baseline)
    situation = check(record, loop, trusted="plant" in given, tuned="controller" in given)
    found = beside_tests(replace(situation, notes=[*situation.notes, *said]), tests)
    behind: CandidateLoops | str = ""
    try:
        refuse_unweighable(record)
        behind = behind if situation.trusted else candidate_loops(record, baseline)
    except UserError as why:
        behind, silent = str(why), f"{FRICTION}: cannot tell, {why}"
        found = replace(
            found, situation=replace(found.situation, notes=[*found.situation.notes, silent])
        )
    sticky = None if isinstance(behind, str) else behind.probability >= DENIED_BELOW
    return found if situation.trusted else plausible(found, sticky), behind


def beside_tests(situation: Situation, tests: Sequence[RecordedTest]) -> Assessment:
    """Assess a record with those of its tests that nothing speaks against; what contradicts is said
    and not counted.
    """
    kept, notes = [], []
    for test in tests:
        one = modelled(test, situation)
        said = contradiction(test, one, situation)
        if said:
            notes.append(f"test: {test.name} contradicts the record and is not counted: {said}")
        else:
            kept.append(one)
    found = assess(situation, kept)
    if kept and situation.trusted:
        others = other_plants(found, found.situation, kept)
        if any(others):
            notes += [
                f"test: {one.name} contradicts the record and is not counted: {said}; the loop"
                f" behind {one.name} is another"
                for one, said in zip(kept, others)
                if said
            ]
            kept = [one for one, said in zip(kept, others) if not said]
            found = assess(situation, kept)
    if kept:
        notes.append(
            f"tests: {', '.join(one.name for one in kept)} judged with the record as one model"
        )
    said = replace(found.situation, notes=[*found.situation.notes, *notes])
    return replace(found, situation=said, asked=tuple(t.id for t in tests))


def _assess_all(
    records: list[LoopRecord],
    baseline: Loop | Partial | None,
    jobs: int,
    tests: Sequence[RecordedTest] = (),
) -> tuple[Assessment, CandidateLoops | str, list[str]]:
    """Assess every record; evidence adds up, and the longest record carries the tests, the fits,
    parameters and the gap.
    """
    longest = max(records, key=lambda r: r.n) if tests else None
    with Parallel(n_jobs=jobs if len(records) > 1 else 1) as parallel:
        calls = (
            delayed(_assess_one)(r, baseline, *((tests,) if r is longest else ())) for r in records
        )
        pairs: list[Any] = list(parallel(calls))
    every = [found for found, _ in pairs]
    main, behind = max(pairs, key=lambda pair: pair[0].situation.record.n)
    others = tuple(f for f in every if f is not main)
    weighed = [one for _, one in pairs if isinstance(one, CandidateLoops)]
    if weighed:
        behind = behind if isinstance(behind, CandidateLoops) else weighed[0]
        behind = replace(behind, log_odds=pooled([one.log_odds for one in weighed]))
        main = replace(main, stiction=behind.probability)
    if not others:
        return main, behind, []
    proven = [e for e in main.log_likelihood_gains if any(e in f.situation.proven for f in every)]
    gains = {
        e: float(sum(f.log_likelihood_gains[e] for f in every))
        for e in main.log_likelihood_gains
        if e not in proven
    }
    gains = dict.fromkeys(main.log_likelihood_gains, SURE) | capped(gains)
    parameters = {e: p for f in [*others, main] for e, p in f.parameters.items()}
    chosen = main.chosen or max((f.chosen for f in every), key=len)
    said = (
        f"{len(every)} records judged together; gap and parameters are those of"
        f" {main.situation.record.tag or 'the longest'}"
    )
    return (
        replace(
            main, log_likelihood_gains=gains, parameters=parameters, chosen=chosen, beside=others
        ),
        behind,
        [said],
    )


def named_by(weights: Classified, found: Assessment) -> list[str]:
    """Return the answer: the most probable, and a second effect of another block that was found on
    top of it.
    """
    p = weights.probability
    if not found.situation.trusted and found.stiction is not None and found.stiction < DENIED_BELOW:
        # friction that is not the more probable, all its effects taken together, is none of them
        p = {e: v for e, v in p.items() if e not in EFFECTS or recogniser(e).band is None}
    first = max(p, key=lambda e: p[e])
    if first not in EFFECTS or first not in found.chosen:
        return [first]
    return [first, *[e for e in found.chosen if block_of(e) != block_of(first)][:1]]


def closing(weights: Classified, found: Assessment, runs: ClosedLoops) -> Classified:
    """Return the probabilities with "unknown" in the place of an effect that does not narrow the
    simulated loop's gap.

    What single samples, the controller's law or MV show stands unless the gap widens beyond its
    interval: a twin may fail for its load's sake.
    """
    named = named_by(weights, found)
    effects = [e for e in named if e in EFFECTS]
    if not effects:
        return _unless_wide(weights, found, runs) if named == [NONE] else weights
    gap = runs.shrink(effects)
    widens = gap.hi < 0.0 if found.shown(effects[0]) else gap.after >= gap.before
    return weights.refuted(effects[0]) if gap.resolvable and widens else weights


def _unless_wide(weights: Classified, found: Assessment, runs: ClosedLoops) -> Classified:
    """Return "unknown" for "none" where a wide gap stays that is not the load's.

    Either the best model leaves something behind, or the record differs from its simulation in
    every stretch of it alike.
    """
    if not _wide(found, runs) or float(np.std(found.base.residual)) < _PREDICTED:
        return weights
    left, block = max(
        (found.tests[name] / limit, block) for name, (limit, block) in RESIDUAL_LIMITS.items()
    )
    if left > 1.0 and not found.situation.trusted:
        return weights.refuted(NONE, block)
    lacks = runs.lacking
    if (
        lacks is None
        or lacks.least <= _WIDE
        or (left <= 1.0 and found.tested and lacks.block != "sensor")
    ):
        # tests under which the model is whole refute that plant, valve or load lack something
        return weights
    return weights.refuted(NONE, block if left > 1.0 else lacks.block)


def _wide(found: Assessment, runs: ClosedLoops) -> bool:
    """Return whether a gap stays that recalibration does not close; an identified baseline is
    recalibrated already.
    """
    gap = runs.shrink([])
    size = gap.recalibrated if found.situation.trusted else max(gap.before, gap.recalibrated)
    return gap.resolvable and size > _WIDE * gap.floor


def report(
    found: Assessment,
    weights: Classified,
    runs: ClosedLoops,
    more: Sequence[str] = (),
    behind: CandidateLoops | str = "",
    judged_by: Classified | None = None,
) -> GapReport:
    """Turn scores and probabilities into the answer; the conclusion is by `judged_by`, before what
    is unknown was described.
    """
    situation = found.situation
    ranking = sorted(weights.probability.items(), key=lambda kv: -kv[1])
    named = named_by(weights, found)
    first = named[0]
    effects = [e for e in named if e in EFFECTS]
    main = runs.shrink(effects)
    rivals = {
        e: runs.rival([e], effects)
        for e, _ in ranking[:3]
        if e in found.parameters and [e] != effects
    }
    shown = {e: gap for e, gap in rivals.items() if gap is not None}
    if len(effects) == 1:
        shown[first] = main
    lines = []
    for e, p in ranking:
        before, after = (
            (shown[e].before, shown[e].after)
            if e in shown
            else (main.before,) * 2
            if e == NONE
            else (None, None)
        )
        lines.append(
            Ranked(e, weights.block(e), float(p), before, after, found.parameters.get(e, {}))
        )
    by_load = first == NONE and _wide(found, runs)
    gap = Gap(
        main.before, main.recalibrated, main.after, main.floor, main.resolvable and not by_load
    )
    shrinkage = None
    if main.value is not None and effects:
        shrinkage = {"value": main.value, "lo": main.lo, "hi": main.hi}
    answers = tuple(
        {
            "block": weights.block(e),
            "effect": e,
            "parameters": found.parameters.get(e, {}),
            "probability": float(weights.probability[e]),
        }
        for e in named
    )
    advice, why, after_tests = _advice(found, weights, runs)
    notes = [
        *situation.notes,
        *more,
        *(f"{block}: {why}" for block, why in found.unexplained.items()),
    ]
    if advice is None:
        notes.append(f"next test: none, {why}")
    if by_load:
        notes.append(
            f"the gap ({main.recalibrated:.2f}, floor {main.floor:.2f}) comes and goes along the"
            " record: a draw of the load"
        )
    if first == UNKNOWN and runs.lacking is not None and runs.lacking.features:
        notes.append(f"the simulation lacks: in the record {runs.lacking.sentence}")
    if not main.resolvable:
        notes.append(
            f"the gap ({main.before:.2f}) does not stand out of its floor ({main.floor:.2f}): no"
            " shrinkage is claimed"
        )
    sizes = smallest_detectable(situation, found.base, load_memory(situation))
    if situation.trusted and not behind:
        test = None if advice is None else f"{advice['test']}: {advice['says']}"
        visible = sizes.get(FRICTION, (float("inf"), ""))[0]
        conclusion = from_posterior(judged_by or weights, named, found, visible, test)
    elif situation.trusted:
        conclusion = without(str(behind), named)
    else:
        conclusion = from_record(Prepared(replace(situation.record, mv=None)), behind)[0]
    group = alike(first, situation, found.parameters.get(first))
    return GapReport(
        block=weights.block(first),
        effect=first,
        effects=answers,
        group=group,
        ranking=tuple(lines),
        gap=gap,
        shrinkage=shrinkage,
        blocks=weights.shares,
        next_test=advice,
        notes=tuple(notes),
        conclusion=conclusion,
        behind=DiagnosisDetails(found, runs, main, sizes, after_tests),
    )


def _advice(
    found: Assessment, weights: Classified, runs: ClosedLoops
) -> tuple[dict[str, Any] | None, str, dict[str, float]]:
    """Return the next test, why there is none, and the probability of a right answer after each
    test.
    """
    s = found.situation
    open_yet = max(weights.probability.values()) < _SETTLED and "raw" not in found.asked
    if open_yet and not (s.law.known or s.archive.faithful):
        says = (
            "log the loop without the archive between: the recorded PV is not the PV the"
            " controller saw"
        )
        raw = {
            "test": "raw",
            "size": 0.0,
            "hold_s": 0.0,
            "separates": [],
            "p_right_after": None,
            "says": says,
        }
        return raw, "", {}
    planned = plan(found, weights.probability, runs, most=_EXPLANATIONS, runs=1, tests=_QUICK_MENU)
    return planned.next_test, planned.why, {x.trial.id: x.p_right for x in planned.tests}
