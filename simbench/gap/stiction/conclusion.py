"""Conclude about one valve: stiction, no stiction or cannot tell, with probability, cause, reason
and next step.

Every verb shows this conclusion; detectors and the chapter's procedure stand below it as evidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from html import escape
from typing import Any

import numpy as np
from scipy.special import logit

from simbench.detectors.errors import Refusal, UserError
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.detectors.views import columns
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.posterior import Posterior
from simbench.gap.effects import is_friction
from simbench.gap.stiction import causes as why
from simbench.gap.stiction.candidate_loops import CandidateLoops, candidate_loops
from simbench.gap.stiction.causes import Cause, Causes, find_causes
from simbench.gap.stiction.deniable import Deniable
from simbench.gap.stiction.friction import stands
from simbench.gap.stiction.probability import probability, verdict
from simbench.gap.stiction.sizes import Size, describe_sizes, sizes_of
from simbench.gap.thresholds import CLAIMED_FROM, LIKELIER, SEIZED
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN

WORDS = {STICTION: STICTION, NO_STICTION: "no stiction", NO_DECISION: "cannot tell"}
_GAIN = "change the controller gain by 30 to 50 % and watch the period"
_BY_HAND = "do a valve travel test by hand"
_REPAIR = "repair the valve if it sticks"
_JUST_BELOW = CLAIMED_FROM - 1e-6  # probability of stiction that was to be claimed, and is not
_NEXT = {
    why.TIGHT: "retune the controller",
    why.FROM_OUTSIDE: "look upstream for what oscillates with this period",
    why.SENSOR: "check the transmitter",
    why.POSITIONER: "tune the positioner, or give it a larger dead-band: it overshoots",
    why.SLOW: "check air supply, positioner and size of the actuator; do a stroke test by hand",
    why.STEPPED: "let OP be sent after smaller changes, then record again",
    why.AT_LIMIT: (
        "free OP from its limit (operating point, valve size; a lower gain or a filter where noise"
        " drives it there), then record again"
    ),
}
_STROKE = (
    "check air supply, positioner and whether the valve is in manual or jammed; then stroke it by"
    " hand"
)
_NOTHING = "nothing to do"
_RECORD_AGAIN = (
    "get a record that can be judged: in automatic mode, without compression or in the smallest"
    " steps that the transmitter reports, 20 to 60 samples per oscillation"
)
_TO_TELL = f"{_GAIN}: it tells friction from everything else"
_ORIGIN = (
    f"{_GAIN}: an oscillation that keeps its period comes from outside, one that dies out was"
    " tuning"
)
_AT_REST = (
    f"record the loop through set-point steps, or {_BY_HAND}: a sticking valve need not oscillate"
)
_WATCH = "nothing to do now: watch whether the loop starts to oscillate"


@dataclass(frozen=True)
class Conclusion:
    """What all evidence at hand shows about one valve.

    `verdict` is "stiction", "no_stiction" or "no_decision"; `probability` that of stiction, None
    where the record cannot be judged; `cause` what moves the loop, or with a loop file what the
    simulation does not model; `reason` one sentence; `next` what to do; `notes` what reading the
    record assumed or left out; `S` and `J` the valve's, with their intervals, where friction is
    more probable than not; `above` the S from which stiction is denied, in words.
    """

    verdict: str
    probability: float | None
    cause: str
    reason: str
    next: str
    notes: tuple[str, ...] = ()
    S: Size | None = None
    J: Size | None = None
    above: str = ""

    def __repr__(self) -> str:
        """Return one line."""
        return f"Conclusion: {self.sentence()}"

    def _repr_html_(self) -> str:
        return "".join(f"<p>{escape(line)}</p>" for line in self.as_lines())

    def as_json(self) -> dict[str, Any]:
        """Return the conclusion in JSON types, without the sizes, which stand beside it."""
        known = {}
        for k, v in asdict(self).items():
            if k not in ("S", "J", "above"):
                known[k] = v
        return {**known, "notes": list(self.notes)}

    def sentence(self) -> str:
        """Return verdict, probability and cause in one line."""
        if self.probability is None:
            p = "unknown"
        else:
            p = f"{self.probability:.2f}"
        word = WORDS[self.verdict]
        if self.verdict == NO_STICTION and self.above:
            word = f"no stiction worth repairing, {self.above} or more"
        return f"{word[0].upper()}{word[1:]} (probability of stiction {p}). Cause: {self.cause}."

    def as_lines(self) -> list[str]:
        """Return the conclusion for people: verdict, reason, next step."""
        return [self.sentence(), f"Reason: {self.reason}.", f"Next: {self.next}."]


def judged(record: LoopRecord) -> tuple[Conclusion, Causes]:
    """Conclude from a record alone, and return the causes weighed."""
    # an MV that stands needs no model
    record = repair_record(record)
    still = stands(record)
    if still is not False:
        conclusion = at_rest(record, sure=still is True)
        if still:
            sure = float(SEIZED)
        else:
            sure = 0.0
        cause = Cause(conclusion.cause, sure, (conclusion.reason,))
        return conclusion, Causes(cause, (cause,))

    # the loops that may have made the record
    try:
        loops: CandidateLoops | Refusal = candidate_loops(record)
    except UserError as reason:
        loops = Refusal(str(reason))
    return from_record(Prepared(replace(record, mv=None)), loops)


def at_rest(record: LoopRecord, *, sure: bool) -> Conclusion:
    """Conclude of an MV that stands, which needs no model: `sure` where the valve does not move
    either.
    """
    # a frozen transmitter looks the same
    if not sure:
        reason = (
            "MV stands while OP moves by many times its noise: the valve does not move, or its"
            " transmitter is frozen, and PV does not tell which"
        )
        return Conclusion(NO_DECISION, None, why.NOT_TOLD, reason, _STROKE, record.notes)

    # PV would follow OP if the valve did
    reason = "MV stands while OP moves by many times its noise, and PV does not follow OP either"
    return Conclusion(STICTION, float(SEIZED), why.AT_REST, reason, _STROKE, record.notes)


def from_record(prepared: Prepared, loops: CandidateLoops | Refusal) -> tuple[Conclusion, Causes]:
    """Conclude from a record alone, and return the causes weighed; parameters as in
    `find_causes`.
    """
    # The causes, and the one that is named
    causes = find_causes(prepared, loops)
    cause = causes.named.name
    swings = prepared.oscillation.sustained
    notes = prepared.record.notes

    # No loop could be identified: the reason says why
    if isinstance(loops, Refusal):
        to_do = _NEXT.get(cause, _RECORD_AGAIN)
        reason = "; ".join(causes.named.speaks_for + (loops.reason,))
        return Conclusion(NO_DECISION, None, cause, reason, to_do, notes), causes

    # The probability decides; reasons for and against friction, then for the cause
    p = loops.probability
    answer = verdict(p)
    friction = next((c for c in causes.weighed if c.name == why.STICKING), causes.named)
    reasons = []
    for c in dict.fromkeys((friction, causes.named)):
        for r in c.speaks_for + c.against:
            reasons.append(r)
    if loops.shown is not None:
        reasons.append(loops.shown.sentence(loops.percent, prepared.record.S_unit))

    # Why a likely friction is not claimed
    if answer == NO_DECISION and p > LIKELIER and loops.unclaimed:
        if p > _JUST_BELOW:
            held = f" (for that the probability is held at {CLAIMED_FROM:g})"
        else:
            held = ""
        reasons.append(f"{loops.unclaimed}{held}")
    reasons += loops.of_mv

    # A loop that does not oscillate may stick all the same
    if answer != STICTION and not swings:
        reasons.append(
            "a sticking valve need not make a loop oscillate, so the probability decides"
        )

    # The next thing to do
    to_do = _NEXT.get(cause) or (_ORIGIN if swings else _WATCH)
    if answer != NO_STICTION:
        to_do = _open_to_do(answer, swings, loops.shown)

    # Sizes only where friction is likelier than not
    S, J = (loops.sizes if p > LIKELIER else None) or (None, None)
    if loops.shown:
        above = loops.shown.size(loops.percent, prepared.record.S_unit)
    else:
        above = ""
    return Conclusion(answer, p, cause, "; ".join(reasons), to_do, notes, S, J, above), causes


def from_posterior(
    weights: Posterior,
    named: Sequence[str],
    assessment: Assessment,
    shown: Deniable | None,
    test: str | None,
) -> Conclusion:
    """Conclude from the posterior of all effects, given a loop file: `shown` is which stiction the
    record would have shown, None where it was not asked, and `test` the one to run next.
    """
    # The probability of friction, and the likeliest answer
    p = weights.friction
    first = named[0]
    answer = verdict(p)
    words = " and ".join(e.replace("_", " ") for e in named)
    reasons = [
        f"the effects with friction have probability {p:.2f}",
        f"the likeliest answer is {words} ({weights.probability[first]:.2f})",
    ]

    # Sizes of the friction that is named
    sticks = []
    for e in named:
        if is_friction(e):
            sticks.append(e)
    if sticks:
        sizes = sizes_of(assessment, sticks[0])
    else:
        sizes = None
    if sizes is not None:
        reasons.append(describe_sizes(*sizes, "% of travel"))

    # What the record shows of friction, or what contradicts the loop file
    if shown is not None:
        reasons.append(shown.sentence(1.0, "% of travel"))
    alone = assessment.friction_alone
    if answer != STICTION and verdict(alone) == STICTION:
        reasons.append(
            f"OP and PV by themselves say stiction ({alone:.2f}), and the loop file contradicts"
            " them: is it this loop's, with its units?"
        )

    # The next thing to do
    if answer == STICTION or (answer == NO_DECISION and test is None):
        to_do = _open_to_do(answer, _record_swings(assessment), shown)
    elif test is not None:
        to_do = test
    elif first == NONE:
        to_do = _NOTHING
    elif first == UNKNOWN:
        to_do = "check the loop file, and record the valve position MV with OP"
    else:
        to_do = f"add {words} to the simulation (`--write-loop`)"

    # Sizes and cause
    S, J = sizes or (None, None)
    cause = why.NOT_TOLD if answer == NO_DECISION else words
    if shown:
        above = shown.size(1.0, "% of travel")
    else:
        above = ""
    return Conclusion(answer, p, cause, "; ".join(reasons), to_do, (), S, J, above)


def _open_to_do(answer: str, swings: bool, shown: Deniable | None) -> str:
    """Return what to do where stiction is claimed or open: the period is watched only of a loop
    that swings.
    """
    if answer == STICTION:
        if swings:
            return f"{_GAIN}, or {_BY_HAND}; {_REPAIR}"
        return f"{_BY_HAND}; {_REPAIR}"
    if shown is not None and shown.again:
        return shown.again
    return _TO_TELL if swings else _AT_REST


def _record_swings(assessment: Assessment) -> bool:
    s = assessment.situation
    return find_oscillation(s.op, np.asarray(s.record.pv), s.record.Ts).sustained


def without(reason: str, named: Sequence[str]) -> Conclusion:
    """Return the conclusion with a loop file where the record cannot be judged for friction."""
    others = []
    for e in named:
        if e in EFFECTS and not is_friction(e):
            others.append(e.replace("_", " "))
    return Conclusion(
        NO_DECISION, None, " and ".join(others) or why.NOT_TOLD, reason, _RECORD_AGAIN
    )


# --- Combine the conclusions of all records of a loop, and count how they agree with labels.

_HEAD = ("loop", "label", "records", "probability of stiction", "conclusion")


def as_lines(
    conclusions: Mapping[str | None, Conclusion], labels: Mapping[str, Mapping[str, str]]
) -> list[str]:
    """Return how often loops and units agree with their labels, below a table of one line per loop
    where one has several records.

    The probability of a loop is that of the mean of its records' log-odds; a record that cannot be
    judged has none.
    """
    loops = group_conclusions(conclusions, labels, "loop")
    rows = []
    for (name, label), (n, p, answer) in loops.items():
        rows.append((name, label, str(n), "" if p is None else f"{p:.2f}", WORDS[answer]))
    several = any(n > 1 for n, _, _ in loops.values())
    return [
        *(columns([_HEAD] + rows) if several else ()),
        count_agreement("loop", loops),
        count_agreement("unit", group_conclusions(conclusions, labels, "unit_group")),
    ]


def group_conclusions(
    conclusions: Mapping[str | None, Conclusion], labels: Mapping[str, Mapping[str, str]], key: str
):
    """Return records, probability and verdict of each group of records that share a key and a
    label.
    """
    # Records of one group and label
    groups: dict[tuple[str, str], list[float | None]] = {}
    for name in (name for name in conclusions if name in labels):
        group = labels[name][key], labels[name]["label"]
        groups.setdefault(group, []).append(conclusions[name].probability)

    # The mean of their log-odds
    out = {}
    for group, each in groups.items():
        odds = [float(logit(p)) for p in each if p is not None]
        if odds:
            p = probability(sum(odds) / len(odds))
        else:
            p = None
        out[group] = len(each), p, NO_DECISION if p is None else verdict(p)
    return out


def count_agreement(
    what: str, groups: Mapping[tuple[str, str], tuple[int, float | None, str]]
) -> str:
    """Return in one sentence how often the conclusions agree with the labels."""
    labelled = []
    for (_, label), (_, _, answer) in groups.items():
        if label not in ("", "unknown"):
            labelled.append((label == STICTION, answer))
    sticky = [answer for sticks, answer in labelled if sticks]
    others = [answer for sticks, answer in labelled if not sticks]
    open_ = (sticky + others).count(NO_DECISION)
    return (
        f"Conclusion by {what}: stiction in {sticky.count(STICTION)} of {len(sticky)} with stiction"
        f" and in {others.count(STICTION)} of {len(others)} without; {open_} of {len(labelled)}"
        " cannot tell."
    )
