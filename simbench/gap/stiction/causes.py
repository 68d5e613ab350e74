"""Find the cause of a loop's oscillation, with evidence for and against each cause; a cause is
named only on evidence for it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from simbench.detectors.errors import Refusal
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.filters import coherence
from simbench.detectors.signal.oscillation import Oscillation
from simbench.gap.stiction import regularity
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.margins import Margins, margins_among
from simbench.gap.stiction.sizes import describe_sizes
from simbench.gap.thresholds import (
    CLAIMED_FROM,
    DENIED_BELOW,
    FEWEST_PER_PERIOD,
    FEWEST_PERIODS,
    KEPT_OPEN,
    KEPT_SURE,
    LIKELIER,
    MOVED,
    NAMED_FROM,
    NOISY,
    RESONANT,
    RINGS,
    STEP_LEAST,
    STEP_RESTS,
    TIGHT_OPEN,
    TIGHT_SURE,
)
from simbench.loop.effects import NONE

STICKING = "stiction"
TIGHT = "tuning"
FROM_OUTSIDE = "disturbance from outside"
POSITIONER = "positioner"
SLOW = "slow valve"
AT_REST = "the valve does not move"
STEPPED = "threshold in the controller"
SENSOR = "sensor"
AT_LIMIT = "saturation"
NO_CAUSE = NONE
NOT_TOLD = "cannot tell"
_BEYOND_SOUND = "more than this loop reaches in simulations without valve friction"
_BLOCK = {
    STICKING: "valve",
    POSITIONER: "valve",
    SLOW: "valve",
    AT_REST: "valve",
    TIGHT: "controller",
    STEPPED: "controller",
    AT_LIMIT: "controller",
    FROM_OUTSIDE: "disturbance",
    SENSOR: "sensor",
}
_CAUSE_OF_FLAG = {
    "saturated": AT_LIMIT,
    "frozen": SENSOR,
    "dead_pv": SENSOR,
    "dead_op": NOT_TOLD,
    "manual": NOT_TOLD,
}


@dataclass(frozen=True)
class Cause:
    """One cause: how sure the evidence makes it (0 to 1), what speaks for it and what against."""

    name: str
    confidence: float
    speaks_for: tuple[str, ...] = ()
    against: tuple[str, ...] = ()

    @property
    def block(self) -> str:
        """The block of the loop in which the cause lies, as an effect does."""
        return _BLOCK.get(self.name, NONE)

    def as_json(self) -> dict[str, Any]:
        """Return the cause in JSON types."""
        return {**asdict(self), "block": self.block}


@dataclass(frozen=True)
class Causes:
    """The cause named, or "cannot tell" with why, and every cause that was weighed, likeliest
    first.
    """

    named: Cause
    weighed: tuple[Cause, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the cause named and those weighed in JSON types."""
        return {"named": self.named.as_json(), "weighed": [c.as_json() for c in self.weighed]}

    def as_lines(self, told: str = "") -> list[str]:
        """Return of the likeliest causes what speaks for and against each, but for what was `told`
        before.
        """
        # Four causes at most
        lines = []
        for c in self.weighed[:4]:
            # What speaks for and against each; what was said above is not repeated
            said = {"for": c.speaks_for, "against": c.against}
            parts = []
            for side, why in said.items():
                if why:
                    parts.append(
                        f"{side}: {'; '.join(r for r in why if r not in told) or 'as said above'}"
                    )

            # Its block, unless the cause is called like it
            if c.block in (NONE, c.name):
                where = ""
            else:
                where = f"{c.block}, "
            lines.append(f"  {c.name} ({where}{c.confidence:.2f}): {'. '.join(parts)}.")
        return lines


def find_causes(prepared: Prepared, loops: CandidateLoops | Refusal) -> Causes:
    """Weigh the causes of one loop's motion; `loops` are those that may have made the record, or
    why none can be identified.
    """
    # What single samples show needs no simulation, unless stiction is claimed
    claimed = not isinstance(loops, Refusal) and loops.probability > CLAIMED_FROM
    if not claimed:
        plain = _see_in_samples(prepared)
        if plain is not None:
            return Causes(plain, (plain,))

    # Without loops all is open
    if isinstance(loops, Refusal):
        return _leave_open(loops.reason, ())

    # A positioner or a slow valve that MV shows
    if not claimed:
        moves = _judge_positioner(loops) or _judge_slow_valve(loops)
        if moves is not None:
            return Causes(moves, (moves,))

    # The rest is weighed side by side
    swing = prepared.oscillation
    tuning, outside = _weigh_oscillation(prepared, loops)
    sticking = _judge_stiction(loops, prepared.record.S_unit)
    sensor = _judge_sensor(prepared, loops)
    nothing = _judge_rest(loops, swing, tuning)
    weighed = sorted((sticking, tuning, outside, sensor, nothing), key=lambda c: -c.confidence)
    return _name_cause(loops, sticking, tuple(weighed))


def _see_in_samples(prepared: Prepared) -> Cause | None:
    """Return the cause that single samples show without any model: a flag of the record's quality,
    or an OP that moves in steps; None where they show none.
    """
    for flag, name in _CAUSE_OF_FLAG.items():
        if flag in prepared.flags:
            sure = 0.0 if name == NOT_TOLD else 0.9
            return Cause(name, sure, (prepared.flags[flag].evidence,))
    step = least_step(np.asarray(prepared.record.op))
    if step is None:
        return None
    unit = "%" if prepared.record.op_percent is not None else "of its unit"
    sent = f"OP moves in steps of at least {step:.3g} {unit} and rests in between"
    return Cause(STEPPED, 0.8, (f"{sent}: a threshold in the controller or what sends OP",))


def _judge_positioner(loops: CandidateLoops) -> Cause | None:
    """Return the positioner as the cause where MV overshoots OP without friction."""
    found = loops.positioner
    if found is None:
        return None
    why = (
        "MV overshoots OP as a valve or positioner of second order does, without friction"
        f" (damping {found['damping']:.2g}, {found['tau']:.2g} s)"
    )
    return Cause(POSITIONER, 0.9, (why,))


def _judge_slow_valve(loops: CandidateLoops) -> Cause | None:
    """Return a slow valve as the cause where MV stays behind OP without friction."""
    if loops.probability > LIKELIER or loops.slow is None:
        return None
    return Cause(SLOW, 0.9, (loops.slow.sentence(),))


def _weigh_oscillation(prepared: Prepared, loops: CandidateLoops) -> tuple[Cause, Cause]:
    """Return tuning and an external oscillation, each as a cause: by how regular the oscillation
    is, where there are periods enough to tell, and else by why it cannot be told.
    """
    # The margins of the loop that is likelier
    swing = prepared.oscillation
    sticks = loops.sticky is not None and loops.probability > LIKELIER
    every = list(loops.healthy) + ([loops.sticky] if loops.sticky is not None else [])
    known = margins_among(every[-1] if sticks else every[0], every)
    if not swing.sustained:
        return _without_line(known, prepared, "the loop does not swing", 0.0)

    # A rhythm, with periods and samples enough to tell a line
    periods = loops.record.duration / swing.period_s
    pace = swing.period_s / loops.record.Ts
    if periods < FEWEST_PERIODS or pace < FEWEST_PER_PERIOD:
        many = pace >= FEWEST_PER_PERIOD
        if many:
            few = f"{periods:.0f} periods"
        else:
            few = f"{pace:.2g} samples each"
        why = f"{few} are too few to tell a line of the load from a resonance"
        return _without_line(known, prepared, why, 0.3)

    # How well it keeps its phase
    keeps = coherence(loops.record.pv, pace)

    # what keeps its phase no better than friction, or a tight loop, would tells nothing
    line = keeps > KEPT_OPEN and keeps > regularity.of_tuning(loops)
    as_much = ""
    if not line:
        as_much = "as much as this loop reaches in simulations"
    elif keeps <= regularity.of_friction(loops):
        as_much = f"{_BEYOND_SOUND}, and as much as with it"
    return (
        _judge_tuning(known, swing, line, keeps),
        _blame_outside(loops, as_much, keeps, periods),
    )


def _without_line(
    known: Margins | None, prepared: Prepared, why: str, open_to: float
) -> tuple[Cause, Cause]:
    """Return tuning and an external oscillation where no line of the load can be seen."""
    tuning = _judge_ringing(known, prepared) or Cause(TIGHT, open_to, (), (why,))
    return tuning, Cause(FROM_OUTSIDE, open_to, (), (why,))


def _name_cause(loops: CandidateLoops, sticking: Cause, weighed: tuple[Cause, ...]) -> Causes:
    """Return the cause that the evidence names, of those weighed, likeliest first."""
    # friction of this valve is a separate cause, whatever else oscillates with it
    if loops.probability > CLAIMED_FROM:
        return Causes(sticking, weighed)
    if loops.probability > LIKELIER:
        why = "friction is more probable than not, but not enough to be claimed"
        return _leave_open(f"{why}, which leaves every other cause open", weighed)
    first = weighed[0]
    if first.confidence < NAMED_FROM or first is sticking:
        return _leave_open("no cause has enough evidence", weighed)
    return Causes(first, weighed)


def _leave_open(why: str, weighed: tuple[Cause, ...]) -> Causes:
    return Causes(Cause(NOT_TOLD, 0.0, (), (why,)), weighed)


def _judge_stiction(loops: CandidateLoops, unit: str) -> Cause:
    p = loops.probability
    word = "better" if loops.gain > 0 else "worse"
    better = (
        f"a model with valve friction explains the record {word} than one without (log-likelihood"
        f" difference {loops.gain:+.0f})"
    )
    if p <= LIKELIER:
        # what fits better is no evidence against, though it is not enough
        if loops.gain > 0:
            sides = ((better,), ())
        else:
            sides = ((), (better,))
        return Cause(STICKING, p, *sides)
    if loops.sizes is not None:
        better += f"; {describe_sizes(*loops.sizes, unit)}"
    return Cause(STICKING, p, (better,))


def _judge_tuning(known: Margins | None, swing: Oscillation, line: bool, keeps: float) -> Cause:
    if known is None:
        return Cause(TIGHT, 0.0, (), ("margins of this loop are unknown",))
    swings = f"{known.sentence()}; the loop swings with {swing.period_s:.3g} s"
    if line:
        kept = f"the phase coherence is {keeps:.2f}, {_BEYOND_SOUND}"
        return Cause(TIGHT, 0.1, (), (kept, swings))
    ratio = swing.period_s / known.period
    if max(known.sensitivity, known.most) < TIGHT_OPEN or not 1.0 / RESONANT <= ratio <= RESONANT:
        return Cause(TIGHT, 0.05, (), (swings,))
    return Cause(TIGHT, _sure_of_tuning(known), (swings,))


def _judge_ringing(known: Margins | None, prepared: Prepared) -> Cause | None:
    """Return tuning as the cause of what a loop does after steps of its set point, where it is
    close to instability; None where it is not, or its set point does not move.
    """
    sp = prepared.record.sp
    if known is None or known.gain >= RINGS or sp is None or np.ptp(sp) <= 0.0:
        return None
    why = f"{known.sentence()}: the loop rings after every step of its set point"
    return Cause(TIGHT, _sure_of_tuning(known), (why,))


def _sure_of_tuning(known: Margins) -> float:
    """Return how sure the largest sensitivity makes tuning as a cause."""
    return float(np.interp(known.sensitivity, (TIGHT_OPEN, TIGHT_SURE), (0.5, 0.95)))


def _blame_outside(loops: CandidateLoops, as_much: str, keeps: float, periods: float) -> Cause:
    kept = f"over {periods:.0f} periods the phase coherence of the oscillation is {keeps:.2f}: "
    if keeps < KEPT_OPEN:
        return Cause(FROM_OUTSIDE, 0.1, (), (f"{kept}no periodic disturbance is seen",))
    if as_much:
        return Cause(FROM_OUTSIDE, 0.3, (), (f"{kept}{as_much}",))
    gained = (
        "an external oscillation explains the record better than none (log-likelihood difference"
        f" +{loops.outside:.0f})"
    )
    sure = float(np.interp(keeps, (KEPT_OPEN, KEPT_SURE), (0.6, 0.95)))
    why = f"{kept}a line in the load's spectrum, more regular than simulations of this loop"
    return Cause(FROM_OUTSIDE, sure, (why, *([gained] if loops.outside > 0 else [])))


def _judge_sensor(prepared: Prepared, loops: CandidateLoops) -> Cause:
    # Spikes are the sensor's
    if "spikes" in prepared.flags:
        return Cause(SENSOR, 0.7, (prepared.flags["spikes"].evidence,))

    # Noise that OP follows, by how much
    op = prepared.record.op
    pv = prepared.record.pv
    share = min(float(loops.healthy[0].noise.std / np.std(pv)), 1.0) ** 2
    noisy = f"noise is {share:.0%} of PV's variance"
    if prepared.record.op_percent is not None:
        moved = float(np.std(np.diff(op)))
    else:
        moved = 0.0

    # Large noise that moves the valve is a cause, other noise is not
    if share > NOISY and moved > MOVED:
        follows = f"{noisy}: the valve follows it, by {moved:.2g} % from sample to sample"
        return Cause(SENSOR, 0.8, (follows,))
    return Cause(SENSOR, 0.05, (), (noisy,))


def _judge_rest(loops: CandidateLoops, swing: Oscillation, tuning: Cause) -> Cause:
    if tuning.confidence >= NAMED_FROM:
        return Cause(NO_CAUSE, 0.0, (), tuning.speaks_for)
    if swing.sustained:
        return Cause(NO_CAUSE, 0.0, (), (f"the loop swings ({swing.evidence})",))
    p = loops.probability
    if p >= DENIED_BELOW:
        return Cause(NO_CAUSE, 1.0 - p, (), ("friction is not ruled out",))
    at_rest = "the loop does not oscillate, and nothing else asks for a cause"
    return Cause(NO_CAUSE, 1.0 - p, (at_rest,))


# --- Recognise an OP that is sent only after a change of a least size: a threshold in the
# controller.

_FEWEST = 8  # moves
_LATTICE = 0.05  # of the least move, within which all moves are multiples of it: that is rounding


def least_step(op: np.ndarray) -> float | None:
    """Return the least size (unit of OP) by which OP (n,) moves, where it rests in between and
    moves by any larger size; None where it does not.
    """
    moves = np.abs(np.diff(op))
    moved = moves[moves > 0.0]
    if moved.size < _FEWEST or moved.size > (1.0 - STEP_RESTS) * moves.size:
        return None
    least = float(moved.min())
    if least < STEP_LEAST * float(np.ptp(op)):
        return None
    ratio = moved / least
    return None if np.all(np.abs(ratio - np.round(ratio)) <= _LATTICE) else least
