"""Compare models with and without valve friction by the likelihood of the record."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import joblib
import numpy as np

from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import RecordError, UserError
from simbench.detectors.judge import UNFIT
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.gap.candidates import fit_candidates, possible_effects, with_ordinary_load
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.identified import plausible, remarks
from simbench.gap.effects import NOT_TRIED, recogniser
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import exact_controller, identify
from simbench.gap.intake.other_loop import refuse_other_plant
from simbench.gap.intake.partial import Partial, completed
from simbench.gap.intake.refuse import refuse_unfit
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import Situation, load_memory
from simbench.gap.stiction.pace import at_its_pace, measured_samples, unheld
from simbench.gap.stiction.probability import (
    BOUNDS,
    SHORTEST_ASKED,
    FrictionEvidence,
    log_odds,
    probability,
)
from simbench.loop.effects import EFFECTS, block_of
from simbench.loop.setup import plain_setup
from simbench.scenarios.spec import Loop, Part, Sampling

FRICTION, _BAND = (
    "stiction",
    "deadband",
)  # the effect whose size is asked for, and friction without a jump
OUTSIDE = "oscillation"  # what swings a sound loop
ENOUGH = 10.0 * BOUNDS[1]  # nats beyond which more say nothing more
# share of PV's samples that must have been measured (`python -m results.studies.plant.archives`)
_MEASURED = 0.2
# of a signal's range, to which it is rounded: no converter tells less (24 bits: 6e-8)
_GRID = 1e-8
_ROOM = 2.0  # number of OP ranges left free on either side of a record whose unit of OP is unknown


@dataclass(frozen=True, eq=False)
class Friction:
    """A record's loop fitted with a sound valve, with friction, and with an oscillation from
    outside, and what that showed.
    """

    assessment: Assessment
    evidence: FrictionEvidence

    @property
    def log_odds(self) -> float:
        """Log-odds of stiction."""
        return log_odds(self.evidence)

    @property
    def probability(self) -> float:
        """Probability of stiction."""
        return probability(self.log_odds)

    @property
    def fitted(self) -> tuple[float, float] | None:
        """S and J (%) of the friction that explains the record best; None where none was fitted."""
        sizes = self.assessment.parameters.get(FRICTION)
        return None if sizes is None else (float(sizes["S"]), float(sizes["J"]))


def probability_of_stiction(record: LoopRecord, loop: Loop | Partial | None = None) -> float | None:
    """Return the probability of stiction as every verb shows it; None where the record cannot be
    judged.
    """
    try:
        return friction(record, loop).probability
    except UserError:
        return None


_KEPT: dict[tuple[Any, ...], Friction] = {}


def friction_of(record: LoopRecord) -> Friction:
    """Return `friction` of a record alone; the last one is kept, as method, conclusion and
    replicates ask in turn.
    """
    signals = (record.op, record.pv, record.sp, record.mv, record.meta.get("manual"))
    about = (record.Ts, record.process, record.kind, record.op_span, record.pv_span, record.tag)
    key = (joblib.hash((signals, about)), *(recogniser(e) for e in EFFECTS))
    if key not in _KEPT:
        _KEPT.clear()
        _KEPT[key] = friction(record)
    return _KEPT[key]


def friction(
    record: LoopRecord, loop: Loop | Partial | None = None, assessment: Assessment | None = None
) -> Friction:
    """Weigh friction on one record, with the loop where it is known, identified from the record
    otherwise.

    The evidence is that of all samples; where that leaves doubt and samples are closer than the
    loop moves, that of the record at the loop's pace if it is larger: between close samples lies
    what no plant of first order describes, between distant ones slips are lost, and with them a
    part of J. What single samples prove is proven by all of them.

    Raises a UserError, in one sentence, where the record is unfit, no loop can be identified, or
    both cannot be compared.
    """
    refuse_unweighable(record)
    # a record, and its tests, that was assessed with this loop is weighed as it was fitted
    if assessment is not None:
        return _measured(assessment)
    where = f"record {record.tag!r}" if record.tag else "record"
    record = in_percent(record)[0]
    if isinstance(loop, Loop):
        loop = with_sound_valve(loop)
    if loop is None and record.mv is None:
        record = unheld(without_last_bits(record))
        count = measured_samples(record)
        if count < max(SHORTEST_ASKED, _MEASURED * record.n):
            what = (
                "the archive repeats the others or draws straight lines between them, which looks"
                " like a valve that rests"
            )
            raise RecordError(
                f"{where} unfit: {count} of {record.n} samples of PV were measured; {what}"
            )
    # thousands of tiny matrices: threads would only wait for each other
    with one_thread():
        # a loop that is known is known at its sampling, and MV shows a slip where it happens
        slow = at_its_pace(record) if loop is None and record.mv is None else record
        if slow is record:
            whole, given, _ = completed(record, loop)
            return _measured(_fitted(record, whole, given))
        every = _identified(record, record)
        if every is not None and every.log_likelihood_gains[FRICTION] >= ENOUGH:
            return _measured(every)
        if every is not None and record.process is None:
            # one loop has one plant, and all samples tell its kind better than few
            integrating = every.situation.baseline.plant.integrating
            slow = replace(slow, process="integrating" if integrating else "self-regulating")
        views = [view for view in (every, _identified(slow, record)) if view is not None]
        if not views:
            return _measured(_fitted(record, identify(record)))
        return _measured(max(views, key=lambda view: view.log_likelihood_gains[FRICTION]))


def refuse_unweighable(record: LoopRecord) -> None:
    """Refuse a record that shows nothing about its valve, whatever is known of its loop."""
    where = f"record {record.tag!r}" if record.tag else "record"
    refuse_unfit(record, where)
    flags = Prepared(record.without_mv()).flags
    unfit = next((flags[f].evidence for f in UNFIT if f in flags), "")
    if record.n < SHORTEST_ASKED:
        unfit = f"{record.n} samples; at least {SHORTEST_ASKED} are needed"
    if unfit:
        raise RecordError(f"{where} unfit: {unfit}")


def with_sound_valve(loop: Loop) -> Loop:
    """Return a loop without the friction of its valve."""
    return (
        loop.model_copy(update={"valve": Part(name="ideal")})
        if plain_setup(loop, 0).sticky
        else loop
    )


def in_percent(record: LoopRecord) -> tuple[LoopRecord, float]:
    """Return the record with OP in %, and how many of `record.S_unit` one % is."""
    if record.op_percent is not None:
        return replace(record, op=record.op_percent, op_span=(0.0, 100.0)), 1.0
    lo, hi = float(record.op.min()), float(record.op.max())
    room = _ROOM * ((hi - lo) or 1.0)
    lo, hi = lo - room, hi + room
    op = (record.op - lo) * (100.0 / (hi - lo))
    return replace(record, op=op, op_span=(0.0, 100.0)), (hi - lo) / 100.0


def without_last_bits(record: LoopRecord) -> LoopRecord:
    """Return the record with OP, and with PV and SP, on a decimal grid a hundred millionth as fine
    as their range: what another unit or another addition rounds differently decides nothing.
    """
    unit = {name: _GRID * _decade(getattr(record, name)) for name in ("op", "pv")}
    unit["sp"] = unit["pv"]
    signals = {
        name: np.round(x / unit[name]) * unit[name]
        for name in unit
        if (x := getattr(record, name)) is not None and unit[name] > 0.0
    }
    return replace(record, **signals)


def _decade(x: np.ndarray) -> float:
    """Return the power of ten next to a signal's range; 0 for one that stands still."""
    wide = float(np.ptp(x))
    return 10.0 ** float(np.round(np.log10(wide))) if wide > 0.0 else 0.0


def _fitted(record: LoopRecord, loop: Loop, given: Collection[str] = ()) -> Assessment:
    """Return the assessment with a loop of which plant, controller, or both, or none, were
    given.
    """
    s = check(record, loop, trusted="plant" in given, tuned="controller" in given)
    # MV is compared with OP by the whole diagnosis alone
    assessment = _few(s) if record.mv is None else assess(s)
    return assessment if s.trusted else plausible(assessment)


def _identified(record: LoopRecord, whole: LoopRecord) -> Assessment | None:
    """Return the assessment of all samples of a record, or of fewer with what the single samples of
    the whole record prove; None where no loop can be identified from them.
    """
    try:
        if record is whole:
            return _fitted(record, identify(record))
        assessment = _fitted(record, identify(record, controller=exact_controller(whole)))
        s = assessment.situation
        sampling = Sampling(Ts=whole.Ts, n=whole.n)
        shown = check(whole, s.baseline.model_copy(update={"sampling": sampling}), trusted=False)
    except UserError:
        return None
    return replace(
        assessment,
        situation=replace(s, proven=shown.proven, notes=[*shown.notes, *remarks(shown)]),
        parameters={e: p for e, p in assessment.parameters.items() if e not in s.proven}
        | shown.proven,
    )


def _few(s: Situation) -> Assessment:
    """Return the assessment of a record without MV in which only friction and what moves like it
    were tried.
    """
    if s.trusted and s.tuned:
        refuse_other_plant(s)
    engine = Engine(s.data, load_memory(s))
    # a load that jumps is no cause here, but friction must
    # explain more than it does
    tried = [e for e in possible_effects(s) if e in (FRICTION, OUTSIDE, "load_steps")]
    # of an identified plant nobody knows how far a load drifts
    tried += ["load_drift"] if s.trusted else []
    bare = engine.base()
    base, fitted = with_ordinary_load(engine, bare, fit_candidates(engine, bare, tried))
    gains = dict.fromkeys(EFFECTS, NOT_TRIED) | {
        e: float(c.log_likelihood_gain) for e, c in fitted.items()
    }
    parameters = {
        e: recogniser(e).numbers(c.fit, s) for e, c in fitted.items() if c.used
    } | s.proven
    return Assessment(s, base, fitted, parameters, [], base, gains)


def _measured(assessment: Assessment) -> Friction:
    """Return the assessment with the evidence that is weighed."""
    gains, s = assessment.log_likelihood_gains, assessment.situation
    if assessment.valve_seen or s.record.mv is not None:
        # what MV does that OP does not is the valve: another map may explain it, nothing outside
        # can, and every band counts in full
        rivals = (
            gains[e] for e in EFFECTS if block_of(e) == "valve" and e not in (FRICTION, _BAND)
        )
        gain = max(gains[FRICTION], gains[_BAND])
        return Friction(assessment, FrictionEvidence(gain, max(rivals), float(gain > 0.0)))
    gains = gains | {
        e: float(c.log_likelihood_gain) for e, c in assessment.before_higher_order.items()
    }
    # friction may have been taken out of the library
    one = (assessment.before_higher_order or assessment.candidates).get(FRICTION)
    span = float(np.quantile(s.op, 0.99) - np.quantile(s.op, 0.01)) or 1.0
    share = one.fit.theta["S"] / span if one is not None and one.used else 0.0
    return Friction(assessment, FrictionEvidence(gains[FRICTION], gains[OUTSIDE], share))
