"""Compare models with and without valve friction by the likelihood of the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import joblib
import numpy as np
from scipy.special import logit

from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import RecordError, UserError
from simbench.detectors.judge import UNFIT
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import PROCESSES, LoopRecord
from simbench.detectors.signal.conditioning import snapped
from simbench.detectors.signal.fits.regression import friction_nats
from simbench.detectors.signal.lattice import written_unit
from simbench.gap.candidates import fit_candidates, possible_effects
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.posterior import nats_of as nats_of_rows
from simbench.gap.effects import is_friction, recogniser
from simbench.gap.intake.check import check, refuse_unfit
from simbench.gap.intake.identify import NoAnswer, identify, law_of
from simbench.gap.intake.partial import Partial, complete_baseline
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.kernels import SKIP
from simbench.gap.likelihood.valve_map import MapSearch, friction_regressed
from simbench.gap.situation import Situation, load_memory, name_of_record
from simbench.gap.stiction.deniable import (
    FRICTION,
    Deniable,
    deniable,
    measured_samples,
    op_range,
    unheld,
)
from simbench.gap.stiction.position import (
    Scale,
    answers,
    chance_of_position,
    may_answer,
    nats_of,
    price_of,
    repeats,
    scale_of,
    standing,
    worth,
)
from simbench.gap.stiction.probability import FrictionEvidence, log_odds, probability
from simbench.gap.stiction.slow import slow_valve
from simbench.gap.thresholds import (
    CLAIMED_FROM,
    DENIED_BELOW,
    LEAST_REGRESSED,
    LIKELIER,
    MEASURED,
    MV_SCALE_NATS,
    SHORTEST_ASKED,
)
from simbench.loop.effects import EFFECTS, block_of

_BELOW = 1e-9  # log-odds, by which what is not claimed stays below the threshold
OUTSIDE = "oscillation"  # what swings a sound loop
FROZEN = (
    "MV stands while PV follows OP, as no valve does: its transmitter is frozen, and the answer"
    " rests on OP and PV"
)
ECHO = "MV repeats OP, as an echo of the command does, and does not deny what OP and PV show"
NO_POSITION = (
    "PV follows from OP through a valve that may stick better than from MV: MV is not the position"
    " of the valve's trim (feedback ahead of the fault, an echo of the command), and does not deny"
    " what OP and PV show"
)
_NOTHING = -10.0  # nats of friction that could not be fitted
# of a signal's range, to which it is rounded: no converter tells less (24 bits: 6e-8)
_GRID = 1e-8
_ROOM = 2.0  # number of OP ranges left free on either side of a record whose unit of OP is unknown


class Told(NamedTuple):
    """The log-odds of stiction by MV and PV together, the record with MV in the unit of OP, or
    without one that is not the valve's position, and what is wrong with MV, in a sentence each.
    """

    log_odds: float
    record: LoopRecord
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Friction:
    """A record's loop fitted with a sound valve, with friction, and with an oscillation from
    outside, and what that showed; `views` are the assessments with each plant that the loop may
    have, the one taken first; `shown` is which stiction would have shown, where the evidence
    speaks against it; `unclaimed` is why friction that explains the record is not claimed, "" for
    nothing; `told` is the answer of both signals, where MV was recorded.
    """

    assessment: Assessment
    evidence: FrictionEvidence
    views: tuple[Assessment, ...] = ()
    shown: Deniable | None = None
    unclaimed: str = ""
    told: Told | None = None

    @property
    def log_odds(self) -> float:
        """Log-odds of stiction: where friction would not have shown, nothing is denied."""
        if self.told is not None:
            return self.told.log_odds
        odds = log_odds(self.evidence)
        if self.unclaimed:
            odds = min(odds, float(logit(CLAIMED_FROM)) - _BELOW)
        denied = self.shown is None or not self.shown.open
        if denied:
            return odds
        return max(odds, float(logit(DENIED_BELOW)))

    @property
    def probability(self) -> float:
        """Probability of stiction."""
        return probability(self.log_odds)

    @property
    def fitted(self) -> tuple[float, float] | None:
        """S and J (%) of the friction that explains the record best; None where none was fitted."""
        sizes = self.assessment.parameters.get(FRICTION)
        if sizes is None:
            return None
        return (float(sizes["S"]), float(sizes["J"]))


_KEPT: dict[tuple[Any, ...], Friction] = {}


def friction_of(record: LoopRecord) -> Friction:
    """Return `friction` of a record alone; the last one is kept, as method and conclusion ask in
    turn.
    """
    signals = (record.op, record.pv, record.sp, record.mv, record.meta.get("manual"))
    about = (record.Ts, record.process, record.kind, record.op_span, record.pv_span, record.tag)
    key = (joblib.hash((signals, about)), *(recogniser(e) for e in EFFECTS))
    if key not in _KEPT:
        _KEPT.clear()
        _KEPT[key] = friction(record)
    return _KEPT[key]


def friction(record: LoopRecord, known: Partial | None = None) -> Friction:
    """Weigh friction on one record, with a loop identified from it, but for what is known of it.

    A self-regulating and an integrating plant are both fitted, and friction must explain more on
    the better of both than no friction does on the better of both: after a valve that rests between
    its slips any plant looks as if it integrated. That holds where the kind is known, too: no plant
    is of first order.

    Raises a UserError, in one sentence, where the record is unfit or no loop can be identified.
    """
    refuse_unweighable(record)
    # thousands of tiny matrices: threads would only wait for each other
    with one_thread():
        if record.mv is None:
            return _ask_what_shows(_weigh_friction(record, known))
        return _with_mv(record, known)


def _ask_what_shows(weighed: Friction) -> Friction:
    """Return what was weighed, with what would have shown where it speaks against friction."""
    if probability(log_odds(weighed.evidence)) >= DENIED_BELOW:
        return weighed
    return replace(weighed, shown=deniable(weighed.assessment))


def _with_mv(record: LoopRecord, known: Partial | None) -> Friction:
    """Return what a record with MV shows of friction: MV counts as far as it is the position of the
    valve, and OP and PV alone where it is not.
    """
    # The record without MV
    alone = _ask_what_shows(_weigh_friction(replace(record, mv=None), known))
    percent = in_percent(record)[0]
    op = np.asarray(percent.op)
    mv = np.asarray(record.mv, dtype=float)

    # An MV that stands still tells of no position
    if standing(op, mv) is not None:
        return replace(alone, told=Told(alone.log_odds, replace(record, mv=None), (FROZEN,)))

    # How likely MV is the position at all
    true = chance_of_position(*_worth_of_mv(alone, mv), alone.log_odds)

    # Friction by MV, weighed with friction without it
    by_mv, scale = _in_scale(record, known, alone.fitted)
    p = true * by_mv.probability + (1.0 - true) * alone.probability

    # What a reader must know of MV
    if record.op_percent is not None:
        notes = [scale.sentence()]
    else:
        notes = []
    if true < LIKELIER:
        notes.append(ECHO if repeats(op, mv) else NO_POSITION)

    # The likelier view of both is told on
    main = alone
    believed = replace(record, mv=None)
    if true >= LIKELIER:
        main = by_mv
        if scale.is_unit:
            believed = replace(record, mv=scale.undone(mv))
        else:
            believed = record
    return replace(main, told=Told(float(logit(p)), believed, tuple(filter(None, notes))))


def _worth_of_mv(alone: Friction, mv: np.ndarray) -> tuple[float, float]:
    """Return the nats by which PV follows from MV rather than from OP through a sound and through a
    sticking valve; none where the archive holds PV, which has fewer samples than MV then.
    """
    views = alone.views or (alone.assessment,)
    if views[0].situation.record.n != mv.size:
        return 0.0, 0.0
    sound, sticky = (
        max((_price_samples(v, e) for v in views), key=np.sum) for e in (None, FRICTION)
    )
    return worth(views, sound, sticky, mv)


def _in_scale(
    record: LoopRecord, known: Partial | None, fitted: tuple[float, float] | None
) -> tuple[Friction, Scale]:
    """Return what MV shows of friction, and its scale, where one explains it plainly better than
    every valve in the unit of OP.
    """
    op = np.asarray(in_percent(record)[0].op)
    mv = np.asarray(record.mv, dtype=float)
    search = MapSearch(op, mv, record.Ts, op)
    scale, nats = scale_of(search, fitted)

    # what the valves in the unit of OP explain
    by_mv = _weigh_friction(record, known)
    rows = nats_of_rows(by_mv.assessment.rows)
    valve = max((n for e, n in rows.items() if block_of(e) == "valve"), default=0.0)
    if nats <= max(valve, 0.0) + MV_SCALE_NATS:
        return _ask_what_shows(by_mv), Scale()

    # no scale where MV only moves more slowly than OP
    slow = slow_valve(search)
    if slow is not None and nats <= slow[0] + MV_SCALE_NATS:
        return _ask_what_shows(by_mv), Scale()
    return _ask_what_shows(_weigh_friction(replace(record, mv=scale.undone(mv)), known)), scale


def as_believed(record: LoopRecord) -> tuple[LoopRecord, tuple[str, ...]]:
    """Return a record with MV in the unit of OP, or without one that is not the position of its
    valve, and what is wrong with MV; one whose valve does not move, or that cannot be weighed, as
    it is.
    """
    if record.mv is None or stands(record) is not False:
        return record, ()
    try:
        told = friction_of(record).told
    except UserError:
        return record, ()
    if told is None or told.record is record:
        return record, ()
    return told.record, told.notes


def stands(record: LoopRecord) -> bool | None:
    """Return whether the valve does not move: MV stands while OP moves, and PV does not follow OP
    either; None where PV leaves open which of valve and transmitter stands.
    """
    # MV stands while OP moves
    if record.mv is None:
        return False
    percent = in_percent(record)[0]
    mv = np.asarray(record.mv, dtype=float)
    here = standing(np.asarray(percent.op), mv)
    if here is None:
        return False

    # whether PV follows OP, by the plants that the loop may have
    part = without_last_bits(percent.without_mv()).with_signals(lambda x: x[here], Ts=record.Ts)
    try:
        refuse_unweighable(part)
        with one_thread():
            views = _assess_both_kinds(part)
            if any(answers(view, mv[here]) for view in views):
                return False
            return None if any(may_answer(view, mv[here]) for view in views) else True
    except NoAnswer:
        return True
    except UserError:
        return False  # whether PV follows OP cannot be told


def _weigh_friction(record: LoopRecord, known: Partial | None) -> Friction:
    """Return what a record shows of friction, before it is asked what would have shown."""
    # Alone the record must have samples that were measured
    where = name_of_record(record)
    record = in_percent(record)[0]
    if known is None and record.mv is None:
        record = unheld(without_last_bits(record))
        count = measured_samples(record)
        if count < max(SHORTEST_ASKED, MEASURED * record.n):
            what = (
                "the archive repeats the others or draws straight lines between them, which looks"
                " like a valve that rests"
            )
            raise RecordError(
                f"{where} unfit: {count} of {record.n} samples of PV were measured; {what}"
            )
        return _likeliest_view(_assess_both_kinds(record))

    # With what is known of its loop
    whole, given, _ = complete_baseline(record, known)
    s = check(record, whole, trusted=False, tuned="controller" in given)

    # MV is compared with OP by the whole diagnosis alone
    if record.mv is None:
        return _likeliest_view([_assess_few(s)])
    return _seen_in_mv(assess(s))


def refuse_unweighable(record: LoopRecord) -> None:
    """Refuse a record that shows nothing about its valve, whatever is known of its loop."""
    where = name_of_record(record)
    refuse_unfit(record, where)
    flags = Prepared(record.without_mv()).flags
    unfit = next((flags[f].evidence for f in UNFIT if f in flags), "")
    if record.n < SHORTEST_ASKED:
        unfit = f"{record.n} samples; at least {SHORTEST_ASKED:g} are needed"
    if unfit:
        raise RecordError(f"{where} unfit: {unfit}")


def in_percent(record: LoopRecord) -> tuple[LoopRecord, float]:
    """Return the record with OP in %, and how many of `record.S_unit` one % is."""
    if record.op_percent is not None:
        return replace(record, op=record.op_percent, op_span=(0.0, 100.0)), 1.0
    lo = float(record.op.min())
    hi = float(record.op.max())
    room = _ROOM * ((hi - lo) or 1.0)
    lo = lo - room
    hi = hi + room
    op = (record.op - lo) * (100.0 / (hi - lo))
    return replace(record, op=op, op_span=(0.0, 100.0)), (hi - lo) / 100.0


def without_last_bits(record: LoopRecord) -> LoopRecord:
    """Return the record with OP, and with PV and SP, on a decimal grid a hundred millionth as fine
    as their range: what another unit or another addition rounds differently decides nothing.
    """
    of_op = _GRID * _decade_of(record.op)
    of_pv = _GRID * _decade_of(record.pv)
    given = (("op", record.op, of_op), ("pv", record.pv, of_pv), ("sp", record.sp, of_pv))
    return replace(record, **{m: snapped(x, unit) for m, x, unit in given if x is not None})


def _decade_of(x: np.ndarray) -> float:
    """Return the power of ten next to a signal's range, which is not 0."""
    return 10.0 ** float(np.round(np.log10(np.ptp(x))))


def _assess_both_kinds(record: LoopRecord) -> list[Assessment]:
    """Return the assessments of a record with the loops of both kinds that can be identified from
    it.
    """
    # The loop of either kind that can be identified
    views = []
    refused = None
    law = law_of(record)
    for process in PROCESSES:
        try:
            loop = identify(replace(record, process=process), law=law)
            views.append(_assess_few(check(record, loop, trusted=False)))
        except UserError as why:
            refused = why

    # None can
    if not views:
        assert refused is not None
        raise refused
    return views


def _assess_few(s: Situation) -> Assessment:
    """Return the assessment of a record without MV in which only friction and an oscillation from
    outside were tried: of an identified plant nobody knows how far a load jumps or drifts.
    """
    engine = Engine(s.data, load_memory(s))
    base = engine.base()
    tried = [e for e in possible_effects(s) if e in (FRICTION, OUTSIDE)]
    fitted = fit_candidates(engine, base, tried)
    used = {e: recogniser(e).numbers(c.fit, s) for e, c in fitted.items() if c.used}
    return Assessment(s, base, fitted, used | s.proven, [], base)


def _likeliest_view(views: Sequence[Assessment]) -> Friction:
    """Return the likeliest of some assessments of one record, of the kind that is known, and what
    they show together: what the best fit with friction explains beyond the best without, sample by
    sample.
    """
    # What friction gains on none, each in its own view
    nats = [{e: _price_samples(v, e) for e in (None, FRICTION)} for v in views]

    # the view in which each is likeliest
    at = {}
    for e in nats[0]:
        at[e] = int(np.argmax([n[e].sum() for n in nats]))
    none = nats[at[None]][None]
    sticky = nats[at[FRICTION]][FRICTION]
    gain = friction_nats(sticky, none)

    # The view that is told first is of the process that is known
    known = []
    for i, v in enumerate(views):
        if _is_kind(v, v.situation.record.process):
            known.append(i)
    first = max(known or range(len(views)), key=lambda i: max(x.sum() for x in nats[i].values()))
    data = views[first].situation.data
    likeliest = views[at[FRICTION]]

    # The evidence, with what a regression finds under a load of any spectrum
    regressed = friction_regressed(data.u, data.y)
    evidence = FrictionEvidence(
        gain + max(regressed.gain, LEAST_REGRESSED),
        _band_of(likeliest),
        regressed.cycles,
        regressed.pace,
    )
    order = (views[first], *(v for v in views if v is not views[first]))
    return Friction(views[first], evidence, order, unclaimed=_why_unclaimed(likeliest, gain))


def _why_unclaimed(likeliest: Assessment, gain: float) -> str:
    """Return why friction that may explain PV in a regression is not claimed, given what it gains
    (nats) in a model of the loop; "" where nothing speaks against a claim.
    """
    # No gain once the loop is modelled
    if gain <= 0.0:
        return (
            "a regression of PV finds a band, but no model of the loop with friction explains the"
            " record better than one without: a gain that changes with load looks like that"
        )

    # A band that OP never passed both ways
    op = likeliest.situation.op
    S = float(likeliest.candidates[FRICTION].fit.theta["S"])
    if passes(S, op):
        return ""
    turned = largest_reversal(op) / S
    return (
        f"OP turned by {turned:.0%} at most of the band that would explain PV, which was never"
        " passed both ways"
    )


def passes(S: float, op: np.ndarray) -> bool:
    """Return whether OP (n,) passed a band S (its unit) both ways: else S is only OP's range."""
    return S <= largest_reversal(op) - written_unit(op)


def largest_reversal(op: np.ndarray) -> float:
    """Return the size (unit of OP) up to which OP (n,) both rose and fell."""
    rise = float((op - np.minimum.accumulate(op)).max())
    fall = float((np.maximum.accumulate(op) - op).max())
    return min(rise, fall)


def _is_kind(view: Assessment, process: str | None) -> bool:
    """Return whether the plant of a view is of a kind; any is where none is known."""
    return process is None or view.situation.integrating == (process == "integrating")


def _price_samples(assessment: Assessment, effect: str | None) -> np.ndarray:
    """Return the log-likelihood of each sample with an effect, or with none, and its share of the
    price of the numbers fitted.
    """
    base = assessment.base
    s = assessment.situation
    fit = base
    price = price_of(assessment)
    if effect is not None:
        one = assessment.candidates.get(effect)
        if one is None:
            return _price_samples(assessment, None) + _NOTHING / (s.data.n - SKIP)
        fit = one.fit
        price = price + one.fit.loglik - base.loglik - one.log_likelihood_gain
    return nats_of(fit, price)


def _band_of(assessment: Assessment) -> float:
    """Return the fitted band over OP's range; 0 where none was fitted."""
    # friction may have been taken out of the library
    one = assessment.candidates.get(FRICTION)
    op = assessment.situation.op
    if one is not None and one.used:
        return one.fit.theta["S"] / (op_range(op) or 1.0)
    return 0.0


def _seen_in_mv(assessment: Assessment) -> Friction:
    """Return what MV shows of friction: what it does that OP does not is the valve; another map may
    explain it, and every band counts in full.
    """
    maps = {}
    for e, n in nats_of_rows(assessment.rows).items():
        if block_of(e) == "valve":
            maps[e] = n
    gain = max((n for e, n in maps.items() if is_friction(e)), default=_NOTHING)
    rival = max((n for e, n in maps.items() if not is_friction(e)), default=0.0)
    return Friction(assessment, FrictionEvidence(gain - max(rival, 0.0), float(gain > 0.0)))
