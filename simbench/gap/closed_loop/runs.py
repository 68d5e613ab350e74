"""Simulate the loops of one diagnosis before and after an effect is added; each simulation is
computed once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from detectors.errors import RecordError
from scenarios.spec import Loop
from simbench.gap.candidates import Fitted
from simbench.gap.closed_loop.gap import Runs, Shrinkage, measure, simulate_runs
from simbench.gap.closed_loop.lacking import Lacking, lacking
from simbench.gap.closed_loop.level import level
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.effects import recogniser
from simbench.gap.likelihood.model import Fit


class ClosedLoops:
    """Simulated loops of one diagnosis, each run once."""

    def __init__(self, fitted: Fitted, seed: int) -> None:
        self.fitted, self.seed = fitted, seed
        self.arms: dict[tuple[str, ...], tuple[Runs, Runs, Runs]] = {}
        self.levelled: dict[tuple[str, ...], Loop] = {}

    def loop(self, effects: Sequence[str], load: Fit | None = None) -> Loop:
        """Return the baseline with some effects in it, under the load of their fit or
        of another one.
        """
        f, fit = self.fitted, self.fit_of(effects)
        numbers = {e: f.parameters[e] for e in effects if e in f.parameters}
        jumps = load_may_jump(effects)
        return fixed_loop(f.situation, fit, numbers, plant="fitted", load=load or fit, jumps=jumps)

    def corrected(self, effects: Sequence[str]) -> Loop:
        """Return the baseline with some effects in it, at the level of the record."""
        key = tuple(effects)
        if key not in self.levelled:
            self.levelled[key] = level(
                self.fitted.situation, self.loop(effects), self.kick(effects), self.seed
            )
        return self.levelled[key]

    def kick(self, effects: Sequence[str]) -> float:
        """Return the offset of OP (%) that starts a cycle under these effects: a sticky loop left
        at rest may stay there.
        """
        known = self.fitted.parameters
        return max(
            (recogniser(e).initial_op_offset(known[e]) for e in effects if e in known), default=0.0
        )

    def fit_of(self, effects: Sequence[str]) -> Fit:
        """Return the fit with some effects."""
        f = self.fitted
        if list(effects) == f.chosen:
            return f.final
        return next((f.candidates[e].fit for e in effects if e in f.candidates), f.base)

    def _after(self, effects: Sequence[str], load: Fit) -> Runs | None:
        loop = self.loop(effects, load)
        return simulate_runs(self.fitted.situation, loop, self.seed, self.kick(effects))

    def runs_with(self, effects: Sequence[str]) -> tuple[Runs, Runs, Runs]:
        """Return runs of the baseline, of the recalibrated loop and of that with some effects, all
        under the load of the effects' fit; the loop before stands for one that runs away.
        """
        key = tuple(effects)
        if key not in self.arms:
            f, s, fit = self.fitted, self.fitted.situation, self.fit_of(effects)
            jumps = load_may_jump(effects)
            before, again = (
                simulate_runs(
                    s, fixed_loop(s, f.base, {}, plant=p, load=fit, jumps=jumps), self.seed
                )
                for p in ("baseline", "fitted")
            )
            if before is None:
                raise RecordError(
                    "the baseline cannot be simulated with this record's set point: it runs away"
                )
            after = self._after(effects, fit) if key else again
            self.arms[key] = (before, again or before, after or before)
        return self.arms[key]

    def shrink(self, effects: Sequence[str]) -> Shrinkage:
        """Return gap before, recalibrated, after and floor for some effects."""
        return measure(self.fitted.situation, *self.runs_with(effects), seed=self.seed)

    @cached_property
    def lacking(self) -> Lacking | None:
        """What the record has and the recalibrated loop has not; None where that cannot be
        simulated.
        """
        f = self.fitted
        return lacking(
            f.situation, fixed_loop(f.situation, f.base, {}, plant="fitted", load=f.base), self.seed
        )

    def rival(self, effects: Sequence[str], named: Sequence[str]) -> Shrinkage | None:
        """Return what other effects close under the load of the named ones; None where that loop
        cannot be simulated.
        """
        before, again, _ = self.runs_with(named)
        after = self._after(effects, self.fit_of(named))
        return (
            None
            if after is None
            else measure(self.fitted.situation, before, again, after, seed=self.seed)
        )


def load_may_jump(effects: Sequence[str]) -> bool:
    """Return whether none of the effects is what ordinary loads do as well."""
    return all(recogniser(e).ordinary is None for e in effects)
