"""The report of a diagnosis: the effect named, and how the gap shrinks once it is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from simbench.detectors.errors import Refusal
from simbench.detectors.prepared import Prepared
from simbench.gap.candidates import find_look_alikes
from simbench.gap.closed_loop.gap import Shrinkage, within_reach
from simbench.gap.closed_loop.remaining import Remaining, remaining
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.posterior import Posterior, known_by
from simbench.gap.effects import is_friction
from simbench.gap.report.ranked import Gap, Ranked, tell_apart
from simbench.gap.report.result import DiagnosisDetails, GapReport
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.conclusion import at_rest, from_posterior, from_record, without
from simbench.gap.stiction.deniable import deniable
from simbench.gap.stiction.friction import stands
from simbench.gap.thresholds import DENIED_BELOW, NEAR
from simbench.loop import resolve
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN


def name_effects(weights: Posterior, assessment: Assessment) -> list[str]:
    """Return the answer: the most probable, and the other effect that was chosen with it."""
    first = weights.first
    chosen = assessment.chosen
    return [first] + [e for e in chosen if first in chosen and e != first]


def report(
    assessment: Assessment,
    weights: Posterior,
    runs: ClosedLoops,
    loops: CandidateLoops | Refusal | None = None,
) -> GapReport:
    """Turn evidence and simulations into the answer."""
    # whether the record would have shown friction that is denied
    s = assessment.situation
    shown = None
    stated = s.trusted and bool(resolve.friction(s.baseline))
    if s.trusted and loops is None and not stated and weights.friction < DENIED_BELOW:
        shown = deniable(assessment)
        if shown.open:
            weights = weights.with_friction(DENIED_BELOW)

    # the posterior beside simulations
    weights, main, left = _beside_simulations(assessment, weights, runs)

    # what stays unknown
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

    # the answers, the likeliest first, and what would tell them apart
    named = name_effects(weights, assessment)
    lines = {}
    for line in _rank_answers(assessment, weights, runs, main, named):
        lines[line.effect] = line
    advice = tell_apart(tuple(lines.values()), assessment.valve_seen)

    # the valve
    still = stands(s.record)
    if still is not False:
        conclusion = at_rest(s.record, sure=still is True)
    elif isinstance(loops, Refusal) and s.trusted:
        conclusion = without(loops.reason, named)
    elif loops is None:
        conclusion = from_posterior(weights, named, assessment, shown, advice)
    else:
        conclusion = from_record(Prepared(replace(s.record, mv=None)), loops)[0]

    # all of it as one answer
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
        shrinkage=_share_closed(main, named, otherwise is not None),
        remaining=left,
        blocks=weights.shares,
        next_test=advice,
        notes=tuple(_note_sentences(assessment, main)),
        conclusion=replace(conclusion, notes=s.record.notes),
        behind=DiagnosisDetails(assessment, runs, None if otherwise is None else otherwise[0]),
        op_unit=s.record.S_unit,
    )


def _beside_simulations(
    assessment: Assessment, weights: Posterior, runs: ClosedLoops
) -> tuple[Posterior, Shrinkage, tuple[Remaining, ...]]:
    """Return the posterior beside simulations with its answer, what they close, and what remains:
    the farther they stay, the likelier is something unknown.
    """
    # the simulation with the answer in it
    named = name_effects(weights, assessment)
    main = runs.shrink([e for e in named if e in EFFECTS])
    left = remaining(assessment.situation, main.features)

    # what its distance says
    times = main.after / (NEAR * main.plant_floor)
    if times > 1.0 and named[0] != UNKNOWN and not is_friction(named[0]):
        if left:
            block = left[0].block
        else:
            block = "disturbance"
        weights = weights.afar(times, block, bool(known_by(assessment.rows)))

    # where it says that no effect is the answer, none is in the simulation
    if weights.first == UNKNOWN and named[0] in EFFECTS:
        main = runs.shrink([])
        left = remaining(assessment.situation, main.features)
    return weights, main, left


def _rank_answers(
    assessment: Assessment,
    weights: Posterior,
    runs: ClosedLoops,
    main: Shrinkage,
    named: Sequence[str],
) -> list[Ranked]:
    """Return every answer, the most probable first; the gap before and after of those that were
    simulated.
    """
    # gaps of the answers that were simulated
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

    # a line for every answer
    return [
        Ranked(
            e,
            weights.block(e),
            float(p),
            *sizes.get(e, (None, None)),
            assessment.parameters.get(e, {}),
            _equal_answers(e, assessment),
        )
        for e, p in ranking
    ]


def _equal_answers(answer: str, assessment: Assessment) -> tuple[str, ...]:
    """Return the answers that the record cannot tell from one, itself among them."""
    if answer in (NONE, UNKNOWN):
        return (answer,)
    return find_look_alikes(answer, assessment.situation, assessment.parameters.get(answer))


def _share_closed(main: Shrinkage, named: Sequence[str], shown: bool) -> dict[str, float] | None:
    """Return the share of the gap that the named effects close, or (`shown`) a part of the
    loop as the record shows it; None where none is claimed.
    """
    if main.value is None or not (shown or named[0] in EFFECTS):
        return None
    return {"value": main.value, "lo": main.lo, "hi": main.hi}


def _note_sentences(
    assessment: Assessment,
    main: Shrinkage,
) -> list[str]:
    """Return what else a reader must know, a sentence each."""
    # of record and samples
    s = assessment.situation
    notes = s.notes + [f"{block}: {why}" for block, why in assessment.unexplained.items()]

    # of the gap and of what the loop file states
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
