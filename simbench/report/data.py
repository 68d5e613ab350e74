"""The data of a report: the arrays and tables of a run, read once for all sections."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pandas as pd
import pyarrow.compute as pc

from simbench.bench.score.scoring import Scores, score_book
from simbench.bench.score.shipped import read_joined
from simbench.bench.store.reading import CODES, RunArrays, read_table
from simbench.detectors.verdict import NO_DECISION, STICTION


@dataclass(frozen=True, eq=False)
class RunData:
    """One run as the report sees it."""

    folder: Path | str  # where it lies
    book: RunArrays  # its tables as arrays
    scores: Scores  # with the oscillation front end

    @classmethod
    def read(cls, folder: str | Path) -> RunData:
        """Read a finished run; raises `RunError` when there is none."""
        book = read_joined(folder)
        return cls(folder, book, score_book(book))

    def of(self, method: str) -> pd.DataFrame:
        """Return one row per scenario whose cycling is clear."""
        book = self.book
        i = book.methods.index(method)
        clear = (book.truth["cycled"] >= 0) & (book.applicable[i] != 0)
        called = book.verdict[i] == CODES[STICTION]
        positive = book.truth["cycled"] == 1
        right = (called == positive) & (book.verdict[i] != CODES[NO_DECISION])
        columns = {
            "score": book.score[i].astype(float),
            "called": called,
            "positive": positive,
            "right": right,
            **book.axes,
        }
        return pd.DataFrame({name: values[clear] for name, values in columns.items()})

    def role(self, method: str) -> str:
        """Return what a method is for, as the manifest has it."""
        return str(self.book.manifest["methods"][method].get("role", "stiction"))

    @cached_property
    def errors(self) -> pd.DataFrame:
        """Detectors that raised and scenarios that could not be run: method, scenario, error."""
        names = {"scenario_id": "scenario"}
        filled = pc.field("error").is_valid()
        raised = read_table(self.folder, "verdicts", ["method", "scenario_id", "error"], filled)
        unrun = read_table(self.folder, "scenarios", ["scenario_id", "error"], filled)
        table = unrun.to_pandas().assign(method="(simulation)")[["method", "scenario_id", "error"]]
        return pd.concat([table, raised.to_pandas()], ignore_index=True).rename(columns=names)

    @cached_property
    def abstentions(self) -> pd.DataFrame:
        """Verdicts "no decision" of methods that did not fail: method, reason; none of a run that
        was stored without reasons.
        """
        undecided = (pc.field("verdict") == NO_DECISION) & pc.field("error").is_null()
        undecided &= pc.field("reason").is_valid()
        table = read_table(
            self.folder, "verdicts", ["method", "reason", "verdict", "error"], undecided
        )
        return table.select(["method", "reason"]).to_pandas()
