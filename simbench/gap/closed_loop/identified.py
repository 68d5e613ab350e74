"""Simulate a loop that was identified from its record: the copy that is nearest to the fitted part,
without and with friction.
"""

from __future__ import annotations

from collections.abc import Sequence

from simbench.detectors.errors import RecordError
from simbench.gap.candidates import Fitted
from simbench.gap.closed_loop.copies import copies
from simbench.gap.closed_loop.described import described
from simbench.gap.closed_loop.gap import Runs, Shrinkage, measure, simulate_runs
from simbench.gap.closed_loop.runs import ClosedLoops, Near, nearest
from simbench.gap.effects import is_friction
from simbench.scenarios.spec import Loop


class IdentifiedLoops(ClosedLoops):
    """Copies of a record, each chosen and run once: nothing but friction can be missing in them, as
    plant, controller, load and archive are the record's own.
    """

    def __init__(self, fitted: Fitted, seed: int) -> None:
        super().__init__(fitted, seed)
        self.chosen: dict[tuple[str, ...], Near] = {}

    def near(self, effects: Sequence[str]) -> Near:
        """Return the copy of the record with the friction of some effects in it that is nearest to
        its fitted part; what else they do is in the copy already.
        """
        # Only friction changes which copy is nearest
        known = self.fitted.parameters
        sticking = []
        for e in effects:
            if is_friction(e) and e in known:
                sticking.append(e)
        key = tuple(sticking)

        # Copies with that friction, the nearest of them
        if key not in self.chosen:
            valve = [{"name": e, **known[e]} for e in key]
            tried = copies(self.fitted.situation, super().corrected(key), valve)
            found = nearest(self.fitted.situation, tried, self.seed)
            if found is None:
                raise RecordError("no loop that is identified from this record can be simulated")
            self.chosen[key] = found
        return self.chosen[key]

    def corrected(self, effects: Sequence[str]) -> Loop:
        """Return the copy with some effects in it."""
        return self.near(effects).copy.loop

    def adds(self, effects: Sequence[str]) -> bool:
        """Return whether some effects are more than what the record's own load does."""
        return any(is_friction(e) for e in effects)

    def described(self, effects: Sequence[str]) -> list[str]:
        """Return what was identified, in sentences."""
        near = self.near(effects)
        load = "Gaussian"
        if near.copy.load != load:
            load = f"drawn again from what the record left, in pieces of {near.copy.load} s"
        kept = "The archive repeats samples as the record's does."
        return described(near.copy.loop) + [f"The load is {load}."] + [kept] * near.held

    def _run_copy(self, effects: Sequence[str]) -> Runs:
        """Return the runs of the copy with some effects."""
        runs = simulate_runs(self.fitted.situation, self.corrected(effects), self.seed)
        if runs is None:
            raise RecordError("the loop that is identified from this record runs away")
        return runs

    def runs_with(self, effects: Sequence[str]) -> tuple[Runs, Runs, Runs]:
        """Return runs of the copy without effects, twice, as it needs no other calibration, and of
        that with some effects.
        """
        key = tuple(filter(is_friction, effects))
        if () not in self.arms:
            bare = self._run_copy([])
            self.arms[()] = bare, bare, bare
        if key not in self.arms:
            self.arms[key] = self.arms[()][:2] + (self._run_copy(key),)
        return self.arms[key]

    def rival(self, effects: Sequence[str], named: Sequence[str]) -> Shrinkage | None:
        """Return what other effects close."""
        try:
            return measure(self.fitted.situation, *self.runs_with(effects), seed=self.seed)
        except RecordError:
            return None
