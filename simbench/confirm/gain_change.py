"""Gain-change test: the period of a stiction cycle changes with the controller gain Kc, that of an
oscillation from outside does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.confirm.rig import Trace, lengthened, run_rig
from simbench.detectors.errors import ParameterError
from simbench.detectors.signal.holds import holds
from simbench.detectors.signal.oscillation import oscillation_of
from simbench.loop.resolve import resolve_loop
from simbench.loop.setup import Setup
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# change of the period that confirms stiction, for a gain change of 30 to 50 % (Choudhury et al.
# 2005)
SHIFT = 0.10
# factor within which stiction keeps the amplitude of OP; an oscillation near the stability limit
# dies
_KEPT = 2.0
PERIODS = 12  # wanted before the change and after it
_SMALLEST = 0.01  # amplitude of OP (%) below which there is nothing to see
LONGEST = 100_000  # samples of one run
_BAND = 0.5  # of OP's std, which it must cross for a new cycle to begin
_WIDE = 1.96  # standard errors on either side of a 95 % interval
NUDGES = (0.0, 3.0, 0.5, 1.0, 1.5, 2.0, 5.0, 8.0)  # load steps (%) tried in turn when a loop rests


@dataclass(frozen=True, eq=False)
class Phase:
    """An oscillation before or after the change of gain."""

    Kc: float  # controller gain (% per PV unit)
    period: float  # s; NaN when there is no sustained oscillation
    amplitude: float  # of OP (%), as sqrt(2) times its standard deviation
    # whether OP rests at its lowest or highest value for more than 2 % of the time: at 0 or 100,
    # or elsewhere for 3 samples or more at a time (the crest of a smooth wave may meet one value in
    # every cycle)
    saturated: bool
    # standard error of the period (s), from the spread of the cycles' lengths
    error: float = np.nan

    def as_json(self) -> dict[str, Any]:
        """Return the numbers, the period with its 95 % interval; None where a number is missing."""
        interval = _interval(self.period, self.error)
        return _plain({
            "Kc": self.Kc, "period": self.period, "period_interval": interval,
            "amplitude": self.amplitude, "saturated": self.saturated,
        })  # fmt: skip


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
            **_plain({"shift": self.shift, "shift_interval": self.shift_interval}),
            "nudge": self.nudge,
            "before": self.before.as_json(),
            "after": self.after.as_json(),
            "reason": self.reason,
        }

    @property
    def shift_interval(self) -> tuple[float, float] | None:
        """95 % interval of |P2/P1 - 1|; None when one of the periods is missing."""
        before, after = self.before, self.after
        ratio = after.period / before.period
        error = ratio * float(np.hypot(before.error / before.period, after.error / after.period))
        ends = _interval(ratio - 1.0, error)
        if ends is None:
            return None
        lo, hi = sorted(abs(x) for x in ends)
        return (0.0 if ends[0] < 0.0 < ends[1] else lo), hi

    def as_text(self) -> str:
        """Return the outcome in three lines."""
        lines = [f"{self.verdict}: {self.reason}"]
        for name, phase in (("before", self.before), ("after", self.after)):
            seen = (
                "no oscillation"
                if np.isnan(phase.period)
                else f"period {phase.period:.4g} s, OP +-{phase.amplitude:.3g} %"
            )
            lines.append(f"{name:<7} Kc {phase.Kc:.4g}: {seen}")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Draw OP and PV around the change of gain."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.5, 4.2), layout="constrained")
        t = np.arange(self.trace.op.size) * self.Ts
        for axes, name, values in zip(
            figure.subplots(2, 1, sharex=True), ("OP (%)", "PV"), (self.trace.op, self.trace.pv)
        ):
            axes.plot(t, values, linewidth=1.0)
            axes.axvline(self.changed * self.Ts, color="0.4", linestyle="--", linewidth=0.8)
            axes.set_ylabel(name)
        figure.axes[0].set_title(
            f"{self.verdict}: {self.reason}", fontsize=8, loc="left", wrap=True
        )
        figure.axes[1].set_xlabel("time (s)")
        return figure


def gain_change(loop: Loop, factor: float = 0.6, seed: int = 0) -> GainChange:
    """Change the controller gain of an oscillating loop and see whether the period follows.

    Stiction when the period shifts by more than 10 % and OP keeps its amplitude, which the valve's
    band sets. Near the stability limit of a healthy loop the period moves too: there the
    oscillation dies or collapses with the gain, and the answer is no decision. A loop at rest is
    nudged by load steps; when it rests all the same there is nothing to confirm. Choudhury,
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


def measure(op: np.ndarray, Ts: float, Kc: float) -> Phase:
    """Return period and amplitude of an oscillating OP; the period is NaN when it is not
    sustained.
    """
    cycle = oscillation_of(op, Ts)
    amplitude = float(np.sqrt(2) * op.std())
    seen = cycle.sustained and amplitude > _SMALLEST
    at_ends = max(_standing(op, float(op.min())), _standing(op, float(op.max())))
    saturated = bool(amplitude > _SMALLEST and at_ends > 0.02)
    if not seen:
        return Phase(Kc, np.nan, amplitude, saturated)
    return Phase(Kc, cycle.period_s, amplitude, saturated, _period_error(op, Ts))


def _period_error(op: np.ndarray, Ts: float) -> float:
    """Return the standard error of the mean cycle (s): cycles lie between upward crossings of a
    band around the mean.
    """
    x = op - op.mean()
    band = _BAND * x.std()
    side = np.where(x > band, 1, np.where(x < -band, -1, 0))
    out = np.flatnonzero(side)
    ups = out[1:][np.diff(side[out]) > 0]
    lengths = np.diff(ups)
    if lengths.size < 2:
        return np.nan
    # two crossings are known to a sample
    return float(np.hypot(lengths.std(ddof=1) / np.sqrt(lengths.size), 1.0 / lengths.size) * Ts)


def _interval(value: float, error: float) -> tuple[float, float] | None:
    return (value - _WIDE * error, value + _WIDE * error) if np.isfinite(value + error) else None


def _standing(op: np.ndarray, value: float) -> float:
    """Return the share of the time that OP rests at a value."""
    length = holds(op)
    there = op[np.cumsum(length) - 1] == value
    return float(length[there & ((length >= 3) | (value in (0.0, 100.0)))].sum() / op.size)


def resolved(loop: Loop, seed: int, samples: int, nudge: float) -> Setup:
    """Resolve a loop with another length and a load step of `nudge` % from the second sample on."""
    setup = resolve_loop(lengthened(loop, samples), seed)
    setup.load_in[1:] += nudge
    return setup


def stepped(samples: int, changed: int, factor: float) -> np.ndarray:
    """Return the factor on Kc at every sample: 1, from `changed` on `factor`."""
    return np.where(np.arange(samples) < changed, 1.0, factor)


def settled_parts(x: np.ndarray, changed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a signal before and after the change, each without its first third, the transient."""
    return x[changed // 3 : changed], x[changed + (x.size - changed) // 3 :]


def _with_nudge(loop: Loop, factor: float, seed: int, nudge: float) -> GainChange:
    changed = max(loop.sampling.n, 300)
    while True:
        n = int((1 + 1 / min(factor, 1.0)) * changed)  # a slower cycle needs more time
        [trace] = run_rig([resolved(loop, seed, n, nudge)], gain=[stepped(n, changed, factor)])
        parts = settled_parts(trace.op, changed)
        phases = [
            measure(op, loop.sampling.Ts, loop.controller.Kc * f)
            for op, f in zip(parts, (1.0, factor))
        ]
        short = any(op.size * loop.sampling.Ts < PERIODS * p.period for op, p in zip(parts, phases))
        if not short or 2 * n > LONGEST:
            break
        changed *= 2
    verdict, reason, shift = judge(*phases)
    return GainChange(verdict, reason, *phases, shift, nudge, loop.sampling.Ts, changed, trace)


def judge(before: Phase, after: Phase) -> tuple[str, str, float]:
    """Return verdict, reason and |P2/P1 - 1| of two phases."""
    change = 100 * (after.Kc / before.Kc - 1)
    if np.isnan(before.period):
        return "no_decision", "the loop has no sustained oscillation to confirm", np.nan
    if np.isnan(after.period):
        return (
            "no_decision",
            (
                f"the oscillation did not go on when Kc changed by {change:+.0f} %: tuning, or too"
                " little kick"
            ),
            np.nan,
        )
    shift = abs(after.period / before.period - 1)
    if before.saturated or after.saturated:
        return "no_decision", "OP runs into its limits, where the gain does not act", shift
    both = (
        f"Kc changed by {change:+.0f} % and the period by"
        f" {100 * (after.period / before.period - 1):+.1f} %"
    )
    if shift <= SHIFT:
        return "no_stiction", f"{both}: the oscillation comes from outside this loop", shift
    ratio = after.amplitude / before.amplitude
    if not 1 / _KEPT <= ratio <= _KEPT:
        return (
            "no_decision",
            f"{both}, but OP's amplitude changed {ratio:.2g}-fold: a loop near its stability limit",
            shift,
        )
    return "stiction", f"{both} while OP kept its amplitude", shift


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in values.items()}
