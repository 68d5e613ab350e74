"""GridGap: how a grid's records differ from recorded ones, as text, JSON and picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from simbench.bench.statistics import Estimate
from simbench.detectors.views import columns
from simbench.page.style import BLUE, GREY, label, panels, styled

_CHANCE = 0.5
_SHOWN = 12  # nuisances in the table on the screen


@dataclass(frozen=True)
class TriedAddition:
    """How well the loops with some nuisances, each in a strength, are told from the records: AUC,
    and the mean probability that the classifier gives to the truth; `loops` could be simulated so.
    """

    chosen: tuple[tuple[str, float], ...]
    auc: Estimate
    certain: float
    loops: int

    def name(self) -> str:
        """Return the nuisances in words."""
        names = [n + ("" if size == 1.0 else f" x {size:g}") for n, size in self.chosen]
        return " and ".join(names)

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON types."""
        added = [{"name": n, "strength": s} for n, s in self.chosen]
        numbers = {"auc": self.auc.value, "lo": self.auc.lo, "hi": self.auc.hi}
        return {"added": added, **numbers, "loops": self.loops}


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
    block : str
        Block of the addition that brings the grid nearest by itself, "none" where none does.
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
    block: str
    refused: Mapping[str, str]

    def __repr__(self) -> str:
        """Return one line."""
        return f"GridGap: {self.sentence()}"

    @property
    def auc(self) -> Estimate:
        """AUC of "recorded or simulated?" on the grid as it is, with its 95 % interval."""
        return self.before.auc

    @property
    def after(self) -> TriedAddition:
        """The grid with all nuisances that help together."""
        if self.together:
            return self.together[-1]
        return self.before

    @property
    def effect(self) -> str:
        """The nuisance that brings the grid nearest by itself, "none" where none does."""
        if self.together:
            return self.together[0].chosen[0][0]
        return "none"

    def sentence(self) -> str:
        """Return the answer in one sentence.

        Returns
        -------
        str
            The AUC before and after what helps.
        """
        auc = _format_auc(self.auc)
        said = f"{self.grid} is told from these {self.records} records with AUC {auc}"
        if not self.together:
            return f"{said}; no effect that was tried brings it nearer."
        return f"{said}; with {self.after.name()} added, with AUC {_format_auc(self.after.auc)}."

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types.

        Returns
        -------
        dict
            AUC, block, effect and additions.
        """
        return {
            "grid": self.grid,
            "loops": self.loops,
            "records": self.records,
            "units": self.units,
            "auc": self.auc._asdict(),
            "block": self.block,
            "effect": self.effect,
            "before": self.before.as_json(),
            "singles": [one.as_json() for one in self.singles],
            "together": [one.as_json() for one in self.together],
            "refused": dict(self.refused),
        }

    def as_text(self) -> str:
        """Return the answer and a table for a terminal.

        Returns
        -------
        str
            Lines for a terminal.
        """
        lines = [self.sentence()]
        if self.singles:
            lines += ["", "With one effect or nuisance added to every loop of the grid:"]
            rows = [("added", "AUC"), ("nothing", _format_auc(self.auc))]
            rows += [(one.name(), _format_auc(one.auc)) for one in self.singles[:_SHOWN]]
            lines += columns(rows)
        lines += ["", f"{self.loops} loops, {self.records} records of {self.units} units."]
        if self.refused:
            lines.append(f"{len(self.refused)} files are no records: {', '.join(self.refused)}.")
        return "\n".join(lines)

    @styled
    def plot(self) -> Figure:
        """Draw the AUC of the grid as it is, and after each addition, with 95 % intervals.

        Returns
        -------
        matplotlib.figure.Figure
            One point with its interval for each step.
        """
        # One line per step, with its interval
        steps = [self.before, *self.together]
        figure, axes = panels(1, 1, 6.0, 1.2 + 0.35 * len(steps))
        (place,) = axes.ravel()
        for k, one in enumerate(steps):
            colour = BLUE if k else GREY
            place.plot([one.auc.lo, one.auc.hi], [-k, -k], color=colour)
            place.plot(one.auc.value, -k, "o", color=colour)
        names = ["as it is"] + [f"+ {one.chosen[-1][0]}" for one in self.together]

        # Names, and the line of chance
        place.set_yticks([-k for k in range(len(steps))], names)
        place.axvline(_CHANCE, color=GREY, linestyle="--", linewidth=0.8)
        place.set_xlim(0.3, 1.02)
        place.margins(y=0.2)
        label(place, "AUC of recorded or simulated", "")
        return figure


def _format_auc(auc: Estimate) -> str:
    return f"{auc.value:.2f} ({auc.lo:.2f} to {auc.hi:.2f})"
