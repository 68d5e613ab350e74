"""GridGap: how a grid's records differ from recorded ones, as text, JSON, page and picture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from simbench.bench.statistics import Estimate
from simbench.detectors.report.report import columns

AUC = "AUC of recorded or simulated"
_CHANCE = 0.5
_SHOWN = 12  # nuisances in the table on the screen


@dataclass(frozen=True)
class MethodAccuracy:
    """How right methods are on some loops: the mean of the shares of sticky and of healthy loops
    that a method answers right, half of one that it does not decide, None where one kind is
    missing; and how many loops there are of both.
    """

    right: Mapping[str, float | None]
    sticky: int
    healthy: int


@dataclass(frozen=True)
class TriedAddition:
    """How well the loops with some nuisances, each in a strength, are told from the records: AUC
    with its interval, and by the features of each block alone; `loops` could be simulated so.
    """

    chosen: tuple[tuple[str, float], ...]
    auc: Estimate
    blocks: Mapping[str, float]
    loops: int

    @property
    def distance(self) -> float:
        """Mean of the AUC and those of the blocks: it still moves where one block alone tells all
        records apart. No block is nearer than chance.
        """
        return float(np.mean([max(x, _CHANCE) for x in (self.auc.value, *self.blocks.values())]))

    def name(self) -> str:
        """Return the nuisances in words."""
        names = [n + ("" if size == 1.0 else f" x {size:g}") for n, size in self.chosen]
        return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


@dataclass(frozen=True, eq=False)
class GridGap:
    """How a grid differs from recorded loops.

    Parameters
    ----------
    grid : str
        Name and version of the grid.
    loops, records, units : int
        How many loops of the grid, records and units of records were compared.
    before : TriedAddition
        The grid as it is.
    singles : tuple of TriedAddition
        Each addition that brings the grid nearer by itself, the best first.
    together : tuple of TriedAddition
        The best with one, two, ... additions.
    accuracy : mapping of tuple to MethodAccuracy
        How right the methods are, by the additions.
    refused : mapping of str to str
        Why a file is no record.
    """

    grid: str
    loops: int
    records: int
    units: int
    before: TriedAddition
    singles: tuple[TriedAddition, ...]
    together: tuple[TriedAddition, ...]
    accuracy: Mapping[tuple[tuple[str, float], ...], MethodAccuracy]
    refused: Mapping[str, str]

    def __repr__(self) -> str:
        """Return one line."""
        return f"GridGap: {self.sentence()}"

    @property
    def auc(self) -> Estimate:
        """AUC of "recorded or simulated?" on the grid as it is, with its 95 % interval."""
        return self.before.auc

    @cached_property
    def after(self) -> TriedAddition:
        """The grid with all nuisances that help together."""
        return self.together[-1] if self.together else self.before

    @property
    def effect(self) -> str:
        """The nuisance that brings the grid nearest by itself, "none" where none does."""
        return self.together[0].chosen[0][0] if self.together else "none"

    @property
    def block(self) -> str:
        """The block that tells the records apart: that of `effect`; where no nuisance helps, the
        block whose features tell most, "none" where the grid cannot be told from the records.
        """
        from simbench.gap.benchmark.nuisances import ADDITIONS

        if self.together:
            return ADDITIONS[self.effect].block
        if self.auc.lo <= _CHANCE:
            return "none"
        return max(self.before.blocks, key=lambda b: self.before.blocks[b])

    def sentence(self) -> str:
        """Return the answer in one sentence.

        Returns
        -------
        str
            The AUC before and after what helps.
        """
        said = f"{self.grid} is told from these {self.records} records with AUC {_words(self.auc)}"
        if not self.together:
            return f"{said}; no effect that was tried brings it nearer."
        return f"{said}; with {self.after.name()} added, with AUC {_words(self.after.auc)}."

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types.

        Returns
        -------
        dict
            AUC, blocks, additions and accuracies.
        """

        def told(one: TriedAddition) -> dict[str, Any]:
            asked = self.accuracy.get(one.chosen)
            return {
                "added": [{"name": n, "strength": s} for n, s in one.chosen],
                "auc": one.auc.value,
                "lo": one.auc.lo,
                "hi": one.auc.hi,
                "blocks": dict(one.blocks),
                "loops": one.loops,
                "accuracy": {} if asked is None else dict(asked.right),
            }

        return {
            "grid": self.grid,
            "loops": self.loops,
            "records": self.records,
            "units": self.units,
            "auc": {"value": self.auc.value, "lo": self.auc.lo, "hi": self.auc.hi},
            "block": self.block,
            "effect": self.effect,
            "before": told(self.before),
            "singles": [told(one) for one in self.singles],
            "together": [told(one) for one in self.together],
            "refused": dict(self.refused),
        }

    def as_text(self) -> str:
        """Return the answer and three tables for a terminal.

        Returns
        -------
        str
            Lines for a terminal.
        """
        lines = [self.sentence(), f"Plainest: {self.block}.", ""]
        lines += [f"{AUC}, by the features of one block, before and after:"]
        lines += columns(self.block_rows())
        if self.singles:
            lines += ["", f"{AUC}, with one effect or nuisance added to every loop of the grid:"]
            lines += columns(self.single_rows()[: _SHOWN + 1])
        if self.accuracy:
            counts = self.accuracy[self.before.chosen]
            lines += [
                "",
                "Accuracy of the detectors (0.5: no better than chance) on the grid's"
                f" {counts.sticky} sticky and {counts.healthy} healthy loops:",
            ]
            lines += columns(self.accuracy_rows([self.before, self.after]))
        lines += [
            "",
            f"{self.loops} loops of the grid, {self.records} records of {self.units} units.",
        ]
        if self.refused:
            lines.append(f"{len(self.refused)} files are no records: {', '.join(self.refused)}.")
        return "\n".join(lines)

    def block_rows(self) -> list[tuple[str, ...]]:
        """Return a head and a row per block, the plainest first.

        Returns
        -------
        list of tuple of str
            The block, and its AUC before and after.
        """
        order = sorted(self.before.blocks, key=lambda b: -self.before.blocks[b])
        rows = [("all", self.before.auc.value, self.after.auc.value)]
        rows += [(b, self.before.blocks[b], self.after.blocks[b]) for b in order]
        return [("block", "before", "after"), *((b, f"{x:.2f}", f"{y:.2f}") for b, x, y in rows)]

    def single_rows(self) -> list[tuple[str, ...]]:
        """Return a head and a row per nuisance that brings the grid nearer, the best first: the AUC
        by all features, and by those of its block.

        Returns
        -------
        list of tuple of str
            The addition, its block, and its AUC.
        """
        from simbench.gap.benchmark.nuisances import ADDITIONS

        rows = [("added", "block", "all", "its block", "before")]
        for one in self.singles:
            block = ADDITIONS[one.chosen[0][0]].block
            numbers = (one.auc.value, one.blocks[block], self.before.blocks[block])
            rows.append((one.name(), block, *(f"{x:.2f}" for x in numbers)))
        return rows

    def accuracy_rows(self, several: Iterable[TriedAddition] = ()) -> list[tuple[str, ...]]:
        """Return a head and a row per method: its accuracy on the grid with some sets of
        nuisances, without any set on all that were asked about.

        Parameters
        ----------
        several : iterable of TriedAddition
            Sets of additions.

        Returns
        -------
        list of tuple of str
            The method, and its accuracy with each set.
        """
        asked = several or (self.before, *self.singles, self.after)
        sets = {one.chosen: one for one in asked if one.chosen in self.accuracy}
        heads = ["as it is", *(f"with {one.name()}" for chosen, one in sets.items() if chosen)]
        if several:
            heads = ["as it is", "with what helps"][: len(sets)]
        said = [self.accuracy[chosen].right for chosen in sets]
        rows = [
            (m, *("-" if told[m] is None else f"{told[m]:.2f}" for told in said)) for m in said[0]
        ]
        return [("method", *heads), *rows]


def _words(auc: Estimate) -> str:
    return f"{auc.value:.2f} ({auc.lo:.2f} to {auc.hi:.2f})"
