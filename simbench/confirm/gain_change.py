"""Gain-change test: a limit cycle of friction answers a change of the controller gain Kc otherwise
than a loop with a sound valve, or than an oscillation from outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.bench.scenario.truth import healthy_twin
from simbench.confirm.expected import (
    Expected,
    Phase,
    expect_change,
    interval,
    measure,
    odds_of_friction,
    plain,
    ratio_error,
    with_friction,
)
from simbench.confirm.rig import Trace, draw_trace, lengthen_loop, run_rig
from simbench.detectors.errors import ParameterError
from simbench.loop.resolve import resolve_loop
from simbench.loop.setup import Setup
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PERIODS = 12  # wanted before the change and after it
TOLD_FROM = float(np.log(4.0))  # log-odds from which one side is believed: a probability of .8
LONGEST = 100_000  # samples of one run
NUDGES = (0.0, 3.0, 0.5, 1.0, 1.5, 2.0, 5.0, 8.0)  # load steps (%) tried in turn when a loop rests


@dataclass(frozen=True, eq=False)
class GainChange:
    """Outcome of a controller gain change."""

    verdict: str  # {"stiction", "no_stiction", "no_decision"}: confirmed, excluded, or cannot tell
    reason: str  # why, in one sentence
    # before, after: the oscillation with the old gain and the new one
    before: Phase
    after: Phase
    shift: float  # |P2/P1 - 1|; NaN when one of the periods is missing
    # load step (%) that was needed to set the loop moving; 0 = it oscillated by itself
    nudge: float
    Ts: float  # sampling period (s)
    changed: int  # sample at which the gain changed
    trace: Trace  # OP, PV and MV of the run

    def as_json(self) -> dict[str, Any]:
        """Return the outcome without its signals; None where a number is missing."""
        return {
            "verdict": self.verdict,
            **plain({"shift": self.shift, "shift_interval": self.shift_interval}),
            "nudge": self.nudge,
            "before": self.before.as_json(),
            "after": self.after.as_json(),
            "reason": self.reason,
        }

    @property
    def shift_interval(self) -> tuple[float, float] | None:
        """95 % interval of |P2/P1 - 1|; None when one of the periods is missing."""
        before = self.before
        after = self.after
        ratio = after.period / before.period
        ends = interval(ratio - 1.0, ratio * ratio_error(before, after))
        if ends is None:
            return None
        lo, hi = sorted(abs(x) for x in ends)
        return (0.0 if ends[0] < 0.0 < ends[1] else lo), hi

    def as_text(self) -> str:
        """Return the outcome in three lines."""
        lines = [f"{self.verdict}: {self.reason}"]
        for name, phase in (("before", self.before), ("after", self.after)):
            if np.isnan(phase.period):
                seen = "no oscillation"
            else:
                seen = f"period {phase.period:.4g} s, OP +-{phase.amplitude:.3g} %"
            lines.append(f"{name:<7} Kc {phase.Kc:.4g}: {seen}")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Draw OP and PV around the change of gain."""
        title = f"{self.verdict}: {self.reason}"
        return draw_trace(self.trace, self.Ts, [self.changed], title)


def gain_change(loop: Loop, factor: float = 0.6, seed: int = 0) -> GainChange:
    """Change the controller gain of an oscillating loop and see whether it answers as one with a
    sound valve, or as one with friction.

    The period of a linear loop moves with the gain, too: under PI on an integrating process with
    1/sqrt(Kc), or it dies out. So the loop is simulated with a sound valve and with friction, and
    the likelier of both is the answer; where they do alike, the answer is no decision. A loop at
    rest is nudged by load steps; when it rests all the same there is nothing to confirm. Choudhury,
    Thornhill and Shah (2005); Thornhill, Cox and Paulonis (2003).
    """
    if not (1 / 3 <= factor <= 3 and abs(factor - 1) >= 0.2):
        raise ParameterError(
            f"gain change: factor = {factor}; at least 20 % more or less is needed, and at most"
            " threefold"
        )
    outcomes = []
    for nudge in NUDGES:
        outcomes.append(_with_nudge(loop, factor, seed, nudge))
        if not np.isnan(outcomes[-1].shift):
            return outcomes[-1]
    return outcomes[0]


def resolve_lengthened(loop: Loop, seed: int, samples: int, nudge: float) -> Setup:
    """Resolve a loop with another length and a load step of `nudge` % from the second sample on."""
    setup = resolve_loop(lengthen_loop(loop, samples), seed)
    setup.load_in[1:] += nudge
    return setup


def gain_factors(samples: int, changed: int, factor: float) -> np.ndarray:
    """Return the factor on Kc at every sample: 1, from `changed` on `factor`."""
    return np.where(np.arange(samples) < changed, 1.0, factor)


def settled_parts(x: np.ndarray, changed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a signal before and after the change, each without its first third, the transient."""
    return x[changed // 3 : changed], x[changed + (x.size - changed) // 3 :]


def _with_nudge(loop: Loop, factor: float, seed: int, nudge: float) -> GainChange:
    # The loop on either side of the change, longer until both show periods
    changed = max(loop.sampling.n, 300)
    while True:
        n = int((1 + 1 / min(factor, 1.0)) * changed)  # a slower cycle needs more time
        [trace] = run_rig(
            [resolve_lengthened(loop, seed, n, nudge)], gain=[gain_factors(n, changed, factor)]
        )
        parts = settled_parts(trace.op, changed)
        phases = []
        for op, f in zip(parts, (1.0, factor)):
            phases.append(measure(op, loop.sampling.Ts, loop.controller.Kc * f))
        short = any(op.size * loop.sampling.Ts < PERIODS * p.period for op, p in zip(parts, phases))
        if not short or 2 * n > LONGEST:
            break
        changed *= 2

    # What changed
    before, after = phases
    what = describe_change(before, after)
    shift = shift_of(before, after)
    verdict = "no_decision"
    reason = unfit(before, after)

    # How likely that is for a sound valve and for a sticking one
    if not reason:
        lengths = (changed - changed // 3, n - changed - (n - changed) // 3)
        gains = (1.0, factor)
        sticky = with_friction(loop, before.amplitude)
        Ts = loop.sampling.Ts
        starts = [(healthy_twin(loop), 0.0, gains)]
        sound = expect_change(starts, lengths, Ts, nudge)
        stuck = expect_change([(one, kick, gains) for one, kick in sticky], lengths, Ts, nudge)
        # what swings the loop from outside stands in its file
        odds = odds_of_friction(before, after, sound, stuck, outside=False)
        near = any(one.near(before, after) for one in (sound, stuck))
        verdict, reason = judge_change(odds, what, sound, stuck, near)

    # The verdict with both phases
    Ts = loop.sampling.Ts
    return GainChange(verdict, reason, before, after, shift, nudge, Ts, changed, trace)


def describe_change(before: Phase, after: Phase) -> str:
    """Return in words what the change of gain did."""
    change = f"Kc changed by {100 * (after.Kc / before.Kc - 1):+.0f} %"
    if not after.goes_on:
        return f"{change} and the oscillation did not go on"
    ratio = after.period / before.period
    return f"{change} and the period by {100 * (ratio - 1):+.1f} %"


def shift_of(before: Phase, after: Phase) -> float:
    """Return |P2/P1 - 1|; NaN when one of the periods is missing."""
    return abs(after.period / before.period - 1)


def unfit(before: Phase, after: Phase) -> str:
    """Return why a change tells nothing; "" where it can tell."""
    if not before.goes_on:
        return "the loop has no sustained oscillation to confirm"
    if before.saturated or after.saturated:
        return "OP runs into its limits, where the gain does not act"
    return ""


def judge_change(
    odds: float, what: str, sound: Expected, stuck: Expected, near: bool
) -> tuple[str, str]:
    """Return verdict and reason of the log-odds of friction that a change of gain shows; a change
    that is not `near` to what either valve does, or where both do alike, tells nothing.
    """
    words = []
    for who, one in (("a sound valve", sound), ("a sticking one", stuck)):
        words.append(f"{who} {_of_period(one)}")
    why = f"{what}; in simulations {words[0]}, {words[1]}"
    if not near:
        return "no_decision", f"{why}: neither is near what was measured"
    if abs(odds) <= TOLD_FROM or (odds > 0.0 and sound.alike(stuck)):
        return "no_decision", f"{why}: the change does not tell which"
    return ("stiction" if odds > 0.0 else "no_stiction"), why


def _of_period(one: Expected) -> str:
    if not len(one.changes):
        return "does not oscillate"
    if np.isnan(one.period):
        return "stops oscillating"
    return f"changes it by {100 * (one.period - 1):+.0f} %"
