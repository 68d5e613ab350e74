"""Diagnose one record against one loop file, from the check of the data to the report (`simbench
gap diagnose`).

The steps stand in `diagnose_all`: assess every record (`_assess_one`), simulate the closed loop
with each effect (`ClosedLoops`), weigh the effects (`classify`), and write the report (`report`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from joblib import Parallel, delayed
from scipy.special import logit

from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import ParameterError, RecordError, Refusal, UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.sources import RecordSignals, as_record
from simbench.gap.closed_loop.identified import IdentifiedLoops
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import NOISE_EFFECT, Assessment, assess
from simbench.gap.decide.posterior import Posterior, posterior
from simbench.gap.intake.check import SAME_TS, check, refuse_unfit
from simbench.gap.intake.healthy import Healthy, check_healthy, learn
from simbench.gap.intake.partial import Partial, complete_baseline, read_baseline
from simbench.gap.report.result import GapReport
from simbench.gap.reporting import report
from simbench.gap.situation import Situation, name_of_record
from simbench.gap.stiction.candidate_loops import CandidateLoops, candidate_loops
from simbench.gap.stiction.conclusion import Conclusion, judged
from simbench.gap.stiction.deniable import FRICTION
from simbench.gap.stiction.friction import as_believed, friction_of, refuse_unweighable
from simbench.gap.stiction.probability import pool_log_odds
from simbench.loop import resolve
from simbench.loop.effects import NONE, block_of
from simbench.safe_path import safe_path
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from simbench.detectors.sources import Source


def diagnose(
    record: Source | Sequence[Source] | None = None,
    baseline: Loop | Partial | str | Path | None = None,
    *,
    identify: bool = False,
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
    # A loop file or none, and at least one record
    if identify and baseline is not None:
        raise ParameterError("gap diagnose: a baseline and identify given; one of both is needed")
    records = _list_records(record, signals)
    if not records:
        raise RecordError("no record to diagnose")

    # One sampling period
    paces = sorted({r.Ts for r in records})
    if paces[-1] > (1.0 + SAME_TS) * paces[0]:
        raise RecordError(
            f"records judged together must have one Ts; it is {paces[0]:g} s in one and"
            f" {paces[-1]:g} s in another"
        )

    # The records with what is known of their loop
    loop = _read_loop(baseline)
    return diagnose_all(records, loop, jobs, seed, [as_record(one) for one in healthy])


def diagnose_all(
    records: list[LoopRecord],
    baseline: Loop | Partial | None,
    jobs: int = 1,
    seed: int = 0,
    healthy: Sequence[LoopRecord] = (),
) -> GapReport:
    """Return the report of `diagnose`, its records and baseline read."""
    # Without a loop file the record is repaired first
    said: list[str] = []
    if baseline is None:
        # what is identified from wild samples or a stopped archive is no loop; beside a loop file,
        # outliers and a frozen sensor are effects that are named
        given = records
        records = [repair_record(one) for one in records]
        said = []
        for old, new in zip(given, records):
            for n in new.notes:
                if n not in old.notes:
                    said.append(n)

    # thousands of tiny matrices: threads would only wait for each other
    with one_thread():
        controls = [check_healthy(one, baseline) for one in healthy]
        if controls:
            ordinary = learn(controls)
        else:
            ordinary = None
        for one in controls:
            note = _not_healthy(one)
            if note:
                said.append(note)
        assessment, loops = _assess_all(records, baseline, jobs, ordinary, seed)

        # The loops that are simulated, and the answer
        kind = ClosedLoops if assessment.situation.stated_parts else IdentifiedLoops
        found = report(assessment, weigh_evidence(assessment), kind(assessment, seed), loops)
    return replace(found, notes=found.notes + tuple(said))


def conclude(
    record: Source | Sequence[Source] | None = None,
    loop: Loop | Partial | str | Path | None = None,
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
    >>> from simbench.detectors.example_loop import example_loop
    >>> conclude(example_loop(noise=0.1)).verdict
    'stiction'
    """
    records = _list_records(record, signals)
    if loop is None and len(records) == 1:
        return judged(records[0])[0]
    return diagnose_all(records, _read_loop(loop)).conclusion


def _read_loop(loop: Loop | Partial | str | Path | None) -> Loop | Partial | None:
    """Return a loop, read from its file where a path is given."""
    if isinstance(loop, (str, Path)):
        return read_baseline(loop)
    return loop


def _list_records(given: Any, signals: Any) -> list[LoopRecord]:
    """Return one record or several as a list."""
    several = isinstance(given, Sequence) and not isinstance(given, str)
    return [as_record(one, **signals) for one in (given if several else [given])]


def _assess_one(
    record: LoopRecord,
    baseline: Loop | Partial | None,
    ordinary: Healthy | None = None,
    seed: int = 0,
) -> tuple[Assessment, CandidateLoops | Refusal | None]:
    """Return the assessment of one record, and the loops that may have made it, or why it is not
    weighed; None where that is not asked.

    With a trusted baseline friction is weighed with all other effects, and what OP and PV show of
    it without that baseline is evidence, where it states none: no loops are needed then.
    """
    # 1. the record and the baseline: can they be compared, and what does the baseline not say?
    refuse_unfit(record, name_of_record(record))
    record, of_mv = as_believed(record)
    loop, given, completions = complete_baseline(record, baseline)
    completions = completions + list(of_mv)
    if ordinary is not None:
        completions = completions + [ordinary.note(loop, record.duration)]
        loop = ordinary.stated_in(loop, record.Ts)

    # 2. what the record shows without any likelihood
    situation = check(record, loop, trusted="plant" in given, tuned="controller" in given)
    situation = replace(situation, notes=situation.notes + completions)
    if ordinary is not None:
        situation = ordinary.ordinary_in(situation)

    # 3. does friction explain the record better than other loops, with nothing known of its loop?
    loops: CandidateLoops | Refusal | None = None
    friction = None
    alone = 0.0
    try:
        refuse_unweighable(record)
        if not situation.trusted:
            loops = candidate_loops(record, baseline)
            friction = loops.probability
        elif record.mv is None and not resolve.friction(situation.baseline):
            alone = _friction_alone(record)
    except UserError as why:
        loops = Refusal(str(why))
        situation.notes.append(f"{FRICTION}: cannot tell, {why}")
        friction = None if situation.trusted else 0.0

    # 4. every effect fitted and scored
    return assess(situation, friction, alone, seed), loops


def _friction_alone(record: LoopRecord) -> float:
    """Return the log-odds of friction by OP and PV, where they speak for it without a model of the
    loop; 0 where they do not, or cannot tell.
    """
    try:
        weighed = friction_of(record)
    except UserError:
        return 0.0
    return max(float(logit(weighed.probability)), 0.0)


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
    ordinary: Healthy | None = None,
    seed: int = 0,
) -> tuple[Assessment, CandidateLoops | Refusal | None]:
    """Assess every record; evidence adds up, and the longest record carries the fits, parameters
    and the gap.
    """
    # Every record by itself, in parallel where there are several
    longest, *shorter = sorted(records, key=lambda r: -r.n)
    assessed = delayed(_assess_one)
    calls = [assessed(r, baseline, ordinary, seed) for r in (longest, *shorter)]
    with safe_path():
        pairs: list[Any] = list(Parallel(n_jobs=jobs if shorter else 1)(calls))
    every = [assessment for assessment, _ in pairs]
    loops = pairs[0][1]

    # Friction by all records that could be weighed
    main, *others = every
    weighed = []
    for _, one in pairs:
        if isinstance(one, CandidateLoops):
            weighed.append(one)
    if weighed:
        loops = replace(weighed[0], log_odds=pool_log_odds([one.log_odds for one in weighed]))
        main = replace(main, friction=loops.probability)

    # One record is what it is
    if not others:
        return main, loops
    main.situation.notes.append(
        f"{len(every)} records judged together; gap and parameters are those of"
        f" {main.situation.record.tag or 'the longest'}"
    )

    # Evidence of all records; the numbers are those of the longest
    rows = []
    for one in every:
        rows += one.rows
    parameters = {}
    for one in reversed(every):
        parameters |= one.parameters
    main = replace(
        main,
        rows=tuple(rows),
        parameters=parameters,
        chosen=main.chosen or max((f.chosen for f in every), key=len),
        other_records=tuple(others),
    )
    return main, loops


def weigh_evidence(found: Assessment) -> Posterior:
    """Return the posterior of an assessment's evidence."""
    return posterior(found.rows, found.first, found.on_top, found.worst_test, found.friction)
