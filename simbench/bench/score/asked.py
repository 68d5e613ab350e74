"""What is asked of the scores of a run: the ranking, a comparison, or rates over axes."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from simbench.bench.score.table import along_lines, two_way_lines

if TYPE_CHECKING:
    import pandas as pd

    from simbench.bench.score.compare import Comparison

PANELS = ("accuracy", "sensitivity", "false_positives")


@dataclass(frozen=True)
class Asked:
    """One question to the scores of a run; without a comparison and axes, the ranking."""

    scores: Any
    truth: str
    paired: bool  # every two methods with each other
    axes: list[str]

    @cached_property
    def comparison(self) -> Comparison | None:
        """The comparison of every two methods, where it is asked for."""
        if self.paired:
            return self.scores.compare(self.truth)
        return None

    @cached_property
    def rates(self) -> pd.DataFrame | None:
        """Rates over the axes; None where none is asked for."""
        if not self.axes:
            return None
        if len(self.axes) == 1:
            axes = self.axes[0]
        else:
            axes = self.axes
        return self.scores.along(axes, self.truth)

    def as_text(self, full: bool, where: str) -> str:
        """Return what is asked for, as text; the ranking, or every table, where it is neither a
        comparison nor rates.
        """
        # What was asked for
        if self.comparison is None:
            parts = []
        else:
            parts = [self.comparison.as_text()]
        if self.rates is not None:
            about = self.rates, self.axes, self.scores.manifest["grid"]
            if len(self.axes) == 1:
                lines = along_lines(*about)
            else:
                lines = two_way_lines(*about, PANELS if self.scores.chosen else PANELS[:1])
            parts.append("\n".join(lines))

        # The ranking where nothing was, or all
        if full or not parts:
            parts.insert(0, self.scores.as_text(self.truth, full, where))
        return "\n\n".join(parts)

    def as_json(self) -> dict[str, Any]:
        """Return the keys that stand beside those of the scores."""
        keys: dict[str, Any] = {}
        if self.comparison is not None:
            keys["comparison"] = self.comparison.as_json()
        if self.rates is not None:
            rows = json.loads(self.rates.to_json(orient="records"))
            if len(self.axes) == 1:
                axis = self.axes[0]
            else:
                axis = self.axes
            keys["by"] = {"axis": axis, "rows": rows}
        return keys
