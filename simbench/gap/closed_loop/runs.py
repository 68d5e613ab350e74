"""Simulate the loops of one diagnosis before and after an effect is added, each once, and choose
the copy of a record whose simulations are nearest to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.gap.candidates import Fitted
from simbench.gap.closed_loop.copies import Copy, archived, shown
from simbench.gap.closed_loop.gap import (
    Runs,
    Shrinkage,
    distance,
    features,
    held_out,
    least_spread,
    measure,
    seed_spread,
    simulate_runs,
)
from simbench.gap.closed_loop.level import kick_of, level, moved, run_with_seeds
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation
from simbench.loop.effects import block_of
from simbench.scenarios.spec import Loop


class ClosedLoops:
    """Simulated loops of one diagnosis, each run once."""

    def __init__(self, fitted: Fitted, seed: int) -> None:
        self.fitted = fitted
        self.seed = seed
        self.arms: dict[tuple[str, ...], tuple[Runs, Runs, Runs]] = {}
        self.levelled: dict[tuple[str, ...], Loop] = {}

    def loop(
        self, effects: Sequence[str], under: Sequence[str] | None = None, plant: str = "fitted"
    ) -> Loop:
        """Return the baseline with some effects in it, under the load of their fit or of the fit
        with others; `plant` is "fitted" or "baseline".
        """
        f = self.fitted
        under = effects if under is None else under
        return fixed_loop(
            f.situation,
            self.fit_of(effects),
            {e: f.parameters[e] for e in effects if e in f.parameters},
            plant=plant,
            load=self.fit_of(under),
            jumps=load_may_jump(effects or under),
        )

    def corrected(self, effects: Sequence[str]) -> Loop:
        """Return the baseline with some effects in it, at the level of the record, and with the
        move of OP that starts their cycle.
        """
        key = tuple(effects)
        if key not in self.levelled:
            loop = level(
                self.fitted.situation, self.loop(effects), self._find_kick(effects), self.seed
            )
            self.levelled[key] = moved(loop, self._find_kick(effects))
        return self.levelled[key]

    def _find_kick(self, effects: Sequence[str]) -> float:
        """Return the offset of OP (%) that starts a cycle under these effects: a sticky loop left
        at rest may stay there.
        """
        known = self.fitted.parameters
        return max((kick_of(known[e]) for e in effects if e in known), default=0.0)

    def as_shown(self, block: str) -> tuple[Copy, Shrinkage] | None:
        """Return the recalibrated loop with the part of a block that no known effect explains as
        the record shows it, and what that closes; None where it closes nothing.
        """
        s = self.fitted.situation
        before, again, _ = self.runs_with([])
        fitted = FittedPart(s)
        tried = [(c, simulate_runs(s, c.loop, self.seed)) for c in shown(s, again.loop, block)]
        found = [(c, runs) for c, runs in tried if runs is not None]
        if not found:
            return None
        copy, after = min(found, key=lambda one: fitted.distance(one[1].archived))
        closed = measure(s, before, again, after, seed=self.seed)
        if closed.after < min(closed.before, closed.recalibrated):
            return (copy, closed)
        return None

    def adds(self, effects: Sequence[str]) -> bool:
        """Return whether a simulation with some effects is another one than that without."""
        return bool(effects)

    def described(self, effects: Sequence[str]) -> list[str]:
        """Return what was identified, in sentences: of a loop that was given, nothing."""
        return []

    def fit_of(self, effects: Sequence[str]) -> Fit:
        """Return the fit with some effects."""
        f = self.fitted
        if set(effects) == set(f.chosen):
            return f.final
        return next((f.candidates[e].fit for e in effects if e in f.candidates), f.base)

    def _simulate_under(
        self, effects: Sequence[str], under: Sequence[str], plant: str = "fitted"
    ) -> Runs | None:
        loop = self.loop(effects, under, plant)
        return simulate_runs(self.fitted.situation, loop, self.seed, self._find_kick(effects))

    def runs_with(self, effects: Sequence[str]) -> tuple[Runs, Runs, Runs]:
        """Return runs of the baseline, of the recalibrated loop and of that with some effects, all
        under the load of the effects' fit; the loop before stands for one that runs away.
        """
        key = tuple(effects)

        # Baseline and recalibrated loop, with the kick that the effects need
        if key not in self.arms:
            before = self._simulate_under([], effects, "baseline")
            again = self._simulate_under([], effects, "fitted")
            if before is None:
                raise RecordError(
                    "the baseline cannot be simulated with this record's set point: it runs away"
                )

            # The loop with the effects; what cannot be simulated is stood in for by the one before
            if key:
                after = self._simulate_under(effects, effects)
            else:
                after = again
            self.arms[key] = (before, again or before, after or before)
        return self.arms[key]

    def shrink(self, effects: Sequence[str]) -> Shrinkage:
        """Return gap before, recalibrated, after and floor for some effects; without any, after is
        the nearer of the two others.
        """
        runs = self.runs_with(effects)
        closed = measure(self.fitted.situation, *runs, seed=self.seed)
        if effects or closed.before >= closed.recalibrated:
            return closed
        return measure(self.fitted.situation, *runs[:2], runs[0], seed=self.seed)

    def rival(self, effects: Sequence[str], named: Sequence[str]) -> Shrinkage | None:
        """Return what other effects close under the load of the named ones; None where that loop
        cannot be simulated.
        """
        before, again, _ = self.runs_with(named)
        after = self._simulate_under(effects, named)
        if after is None:
            return None
        return measure(self.fitted.situation, before, again, after, seed=self.seed)


def load_may_jump(effects: Sequence[str]) -> bool:
    """Return whether none of the effects is what ordinary loads do as well."""
    return all(block_of(e) != "disturbance" for e in effects)


# --- Choose among the loops that may copy a record the one whose simulations are nearest to the
# part that was fitted.

_SEEDS = 16  # simulations of each
_FROM = 0.3  # of the record: what lies before is the way from rest


class Near(NamedTuple):
    """The loop that copies a record, what it is made of, whether its archive repeats samples, and
    how far its simulations are from the fitted part.
    """

    copy: Copy
    held: bool
    distance: float


def nearest(s: Situation, tried: Iterable[Copy], seed: int = 0) -> Near | None:
    """Return the copy of a record whose simulations are nearest to it between 30 and 65 %, of
    copies as near the plainest; None where none can be simulated.
    """
    fitted = FittedPart(s)
    found: list[Near] = []
    repeats = any(np.any(np.diff(x) == 0.0) for x in (s.op, s.record.pv))
    for copy in tried:
        for held in (False, True) if repeats else (False,):
            loop = archived(copy.loop, s, held)
            records = run_with_seeds(loop.with_("sampling.n", held_out(s)), seed, _SEEDS)
            if records is None:
                continue
            runs = np.array([(r.op, r.pv) for r in records])
            found.append(Near(copy._replace(loop=loop), held, fitted.distance(runs)))
    return min(found, key=lambda near: near.distance, default=None)


class FittedPart:
    """The part of a record, from 30 to 65 %, by which loops are chosen that were fitted to it."""

    def __init__(self, s: Situation) -> None:
        self.part = slice(int(_FROM * s.record.n), held_out(s))
        self.sp = s.sp[self.part]
        named = features(s.op[self.part], s.record.pv[self.part], self.sp)
        self.real = np.array(list(named.values()))
        self.least = least_spread(named, self.sp.size)

    def distance(self, runs: np.ndarray) -> float:
        """Return how far OP and PV of simulations, shape (seeds, 2, n), are from the record."""
        op = runs[:, 0, self.part]
        pv = runs[:, 1, self.part]
        simulated = np.array(list(features(op, pv, self.sp).values())).T
        return distance(self.real, simulated, seed_spread(simulated, self.least))
