"""Find the cause of a loop's oscillation, with evidence for and against each cause; a cause is
named only on evidence for it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from detectors.prepared import Prepared
from detectors.signal.oscillation import Oscillation
from detectors.signal.phase import coherence
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.margins import Margins, margins
from simbench.gap.stiction.probability import CLAIMED_FROM, DENIED_BELOW

STICKING, TIGHT, FROM_OUTSIDE, NEIGHBOUR = (
    "stiction",
    "tuning",
    "disturbance from outside",
    "another loop",
)
SENSOR, AT_LIMIT, NO_CAUSE, NOT_TOLD = "sensor", "saturation", "none", "cannot tell"
_CAUSE_OF_FLAG = {
    "saturated": AT_LIMIT,
    "frozen": SENSOR,
    "dead_pv": SENSOR,
    "dead_op": NOT_TOLD,
    "manual": NOT_TOLD,
}
_NAMED_FROM = 0.6  # confidence below which no cause is named
_APART = 0.15  # confidence by which the likeliest must lead the next
_KEPT = (
    0.9,
    0.98,
)  # share of the phase that one sine keeps: from the first on the oscillation may come from the
# load, from the second on it surely does
_FEWEST_PERIODS = 12  # periods below which every swing keeps its phase
_TIGHT = (
    2.2,
    4.0,
)  # largest sensitivity from which tuning may be the cause, and from which it surely can
_BARE = 0.1  # share of S below which J is no jump
_MOVED = 1.0  # % by which OP moves from sample to sample where noise wears the valve
_POOR = 1.9  # largest sensitivity from which a loop at rest is not sound either
# factor between the period of the loop and that of its resonance up to which they are one
_NEAR = 1.4
# share of PV's variance that changes from sample to sample, from which it is noise that moves the
# valve
_NOISY = 0.75


@dataclass(frozen=True)
class Cause:
    """One cause: how sure the evidence makes it (0 to 1), what speaks for it and what against."""

    name: str
    confidence: float
    speaks_for: tuple[str, ...] = ()
    against: tuple[str, ...] = ()


@dataclass(frozen=True)
class Causes:
    """The cause named, or "cannot tell" with why, and every cause that was weighed, likeliest
    first.
    """

    named: Cause
    weighed: tuple[Cause, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the cause named and those weighed in JSON types."""
        return {"named": asdict(self.named), "weighed": [asdict(c) for c in self.weighed]}

    def as_lines(self) -> list[str]:
        """Return of the likeliest causes what speaks for and against each."""
        return [*map(_line, self.weighed[:4])]


def _line(c: Cause) -> str:
    parts = [f"for: {'; '.join(c.speaks_for)}"] if c.speaks_for else []
    parts += [f"against: {'; '.join(c.against)}"] if c.against else []
    return f"  {c.name} ({c.confidence:.2f}): {'. '.join(parts)}."


def find_causes(
    prepared: Prepared, loops: CandidateLoops | str, root: str | None = None, sure: float = 0.0
) -> Causes:
    """Weigh the causes of one loop's motion; `loops` are those that may have made the record, or
    why none can be identified.

    `root` is the loop that drives it, `sure` that loop's probability of stiction.
    """
    flags, swing = prepared.flags, prepared.oscillation
    claimed = not isinstance(loops, str) and loops.probability > CLAIMED_FROM
    for flag, name in _CAUSE_OF_FLAG.items():
        if flag in flags and not claimed:
            cause = Cause(name, 0.9 if name != NOT_TOLD else 0.0, (flags[flag].evidence,))
            return Causes(cause, (cause,))
    if isinstance(loops, str):
        return _open(loops, ())
    known, keeps, periods = _margins(loops), 0.0, 0.0
    if swing.sustained:
        periods = loops.record.duration / swing.period_s
        keeps = (
            coherence(loops.record.pv, swing.period_s / loops.record.Ts)
            if periods >= _FEWEST_PERIODS
            else float("nan")
        )
    weighed = [
        _stiction(loops, keeps),
        _tuning(known, swing, keeps, periods),
        _outside(loops, swing, keeps, periods),
        _sensor(prepared, loops),
    ]
    if root is not None:
        why = (
            f"shares period, phase and time with {root}, whose valve sticks with probability"
            f" {sure:.2f}"
        )
        weighed.append(Cause(NEIGHBOUR, sure, (why,)))
    weighed.append(_nothing(loops, swing, known))
    weighed.sort(key=lambda c: -c.confidence)
    first, second = weighed[:2]
    # friction of this valve is a separate cause, whatever else oscillates with it
    sticking = next(c for c in weighed if c.name == STICKING)
    if root is not None and sure > CLAIMED_FROM and sure >= sticking.confidence - 0.1:
        return Causes(next(c for c in weighed if c.name == NEIGHBOUR), tuple(weighed))
    if sticking.confidence > CLAIMED_FROM:
        return Causes(sticking, tuple(weighed))
    if claimed:
        return _open("the swing speaks against a valve that sticks", tuple(weighed))
    if loops.probability >= DENIED_BELOW:
        between = (
            f"a probability between {DENIED_BELOW:g} and {CLAIMED_FROM:g} leaves the valve open"
        )
        return _open(f"{between}, and with it every other cause", tuple(weighed))
    if first.confidence < _NAMED_FROM or first is sticking:
        return _open("no cause has enough evidence", tuple(weighed))
    if first.confidence - second.confidence < _APART and {first.name, second.name} != {
        SENSOR,
        NO_CAUSE,
    }:
        return _open(f"{first.name} and {second.name} are about as likely", tuple(weighed))
    return Causes(first, tuple(weighed))


def _open(why: str, weighed: tuple[Cause, ...]) -> Causes:
    return Causes(Cause(NOT_TOLD, 0.0, (), (why,)), weighed)


def _margins(loops: CandidateLoops) -> Margins | None:
    """Return the margins of the loop that explains the record best."""
    loop = (
        loops.sticky if loops.sticky is not None and loops.probability > 0.5 else loops.healthy[0]
    )
    return margins(loop)


def _stiction(loops: CandidateLoops, keeps: float) -> Cause:
    p = loops.probability
    word = "better" if loops.gain > 0 else "worse"
    better = (
        f"a model with valve friction explains the record {word} than one without (log-likelihood"
        f" difference {loops.gain:+.0f})"
    )
    if p <= 0.5:
        return Cause(STICKING, p, (), (better,))
    size = (
        ""
        if loops.fitted is None
        else f"; estimated S = {loops.fitted[0]:.2g}, J = {loops.fitted[1]:.2g} % of travel"
    )
    bare = loops.fitted is not None and loops.fitted[1] < _BARE * loops.fitted[0]
    if bare and keeps > _KEPT[1] and loops.healthy[0].plant.type == "foptd":
        why = (
            "a band without a jump makes no self-regulating loop swing, and the swing keeps its"
            " phase as one from outside"
        )
        return Cause(STICKING, min(p, CLAIMED_FROM - 0.05), (better + size,), (why,))
    return Cause(STICKING, p, (better + size,))


def _tuning(known: Margins | None, swing: Oscillation, keeps: float, periods: float) -> Cause:
    if known is None:
        return Cause(TIGHT, 0.0, (), ("margins of this loop are unknown",))
    margins_text = known.sentence()
    if not swing.sustained:
        return Cause(TIGHT, 0.0, (), ("the loop does not swing", margins_text))
    if keeps > _KEPT[0]:
        kept = (
            f"the phase coherence over {periods:.0f} periods is {keeps:.2f}, more than noise in a"
            " tight loop gives"
        )
        return Cause(TIGHT, 0.1, (), (kept, margins_text))
    if np.isnan(keeps):
        few = f"{periods:.0f} periods are too few to tell a line of the load from a resonance"
        return Cause(TIGHT, 0.3, (), (few, margins_text))
    ratio = max(known.period / swing.period_s, swing.period_s / known.period)
    if known.sensitivity < _TIGHT[0] or ratio > _NEAR:
        return Cause(
            TIGHT, 0.05, (), (f"{margins_text}; the loop swings with {swing.period_s:.3g} s",)
        )
    tight = float(np.interp(known.sensitivity, _TIGHT, (0.5, 0.95)))
    return Cause(
        TIGHT, tight, (f"{margins_text}, near the {swing.period_s:.3g} s with which it swings",)
    )


def _outside(loops: CandidateLoops, swing: Oscillation, keeps: float, periods: float) -> Cause:
    if not swing.sustained:
        return Cause(FROM_OUTSIDE, 0.0, (), ("the loop does not swing",))
    if np.isnan(keeps):
        return Cause(
            FROM_OUTSIDE,
            0.3,
            (),
            (f"{periods:.0f} periods are too few to tell a line of the load from a resonance",),
        )
    kept = f"over {periods:.0f} periods the phase coherence of the oscillation is {keeps:.2f}: "
    if keeps < _KEPT[0]:
        return Cause(FROM_OUTSIDE, 0.1, (), (f"{kept}no periodic disturbance is seen",))
    gained = (
        "an external oscillation explains the record better than none (log-likelihood difference"
        f" +{loops.outside:.0f})"
    )
    sure = float(np.interp(keeps, _KEPT, (0.6, 0.95))) * float(
        np.interp(loops.probability, (0.4, 0.7), (1.0, 0.3))
    )
    line = f"{kept}a line in the load's spectrum, narrower than a loop resonates"
    return Cause(FROM_OUTSIDE, sure, (line, *([gained] if loops.outside > 0 else [])))


def _sensor(prepared: Prepared, loops: CandidateLoops) -> Cause:
    record = prepared.record
    std = float(np.std(record.pv))
    noise = min(float(loops.healthy[0].noise.std) / std, 1.0) if std > 0 else 0.0
    steps = np.diff(record.op)
    turns = float(np.mean(steps[1:] * steps[:-1] < 0)) if steps.size > 1 else 0.0
    noisy = f"noise is {noise**2:.0%} of PV's variance, and OP turns in {turns:.0%} of the samples"
    if "spikes" in prepared.flags:
        return Cause(SENSOR, 0.7, (prepared.flags["spikes"].evidence,))
    percent = record.op_percent
    moved = float(np.std(steps)) if percent is not None else 0.0
    if noise**2 > _NOISY and turns > 0.4 and moved > _MOVED and not prepared.oscillation.sustained:
        return Cause(
            SENSOR,
            0.8,
            (f"{noisy}: the valve follows the noise, by {moved:.2g} % from sample to sample",),
        )
    return Cause(SENSOR, 0.05, (), (noisy,))


def _nothing(loops: CandidateLoops, swing: Oscillation, known: Margins | None) -> Cause:
    if swing.sustained:
        return Cause(NO_CAUSE, 0.0, (), (f"the loop swings ({swing.evidence})",))
    p = loops.probability
    if p >= DENIED_BELOW:
        return Cause(NO_CAUSE, 1.0 - p, (), ("friction is not ruled out",))
    at_rest = "the loop does not oscillate, and nothing else asks for a cause"
    if known is not None and known.sensitivity > _POOR:
        return Cause(NO_CAUSE, 0.7 * (1.0 - p), (at_rest,), (known.sentence(),))
    return Cause(NO_CAUSE, 1.0 - p, (at_rest,))
