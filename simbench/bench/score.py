"""Score a run: every detector against sticky, predicted and cycled, over all and by axis, with and without front end."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.bench.statistics import auc, wilson
from simbench.bench.store import TRUTHS, Book
from simbench.bench.tables import AXES
from simbench.files import whole_file

if TYPE_CHECKING:
    import pandas as pd

FRONT, RAW = "front end", "raw"
RATES = ("accuracy", "decided", "no_decision", "false_alarm", "miss")


@dataclass(frozen=True, eq=False)
class Scores:
    """What a run says about its detectors.

    Parameters
    ----------
    table : DataFrame
        One row per method, truth and mode ("front end" or "raw"): n, positives, and with Wilson intervals (NAME_lo, NAME_hi)
        accuracy over all, accuracy over decided, no_decision, false_alarm (of negatives), miss (of positives); auc over
        records with a score, with DeLong's interval; errors; median runtime in ms.
    by_axis : DataFrame
        The same against `cycled` by axis and value, without AUC's interval.
    disagreement : DataFrame
        How often sticky, predicted and cycled say what together.
    manifest : dict
        Of the run.
    first : str
        The mode shown first.
    """

    table: pd.DataFrame
    by_axis: pd.DataFrame
    disagreement: pd.DataFrame
    manifest: dict[str, Any]
    first: str = FRONT

    def ranking(self, truth: str = "cycled", mode: str | None = None) -> pd.DataFrame:
        """Return the rows of one truth and mode, best accuracy first, nonlinearity tests and the oracle last."""
        rows = self.table[(self.table.truth == truth) & (self.table["mode"] == (mode or self.first))]
        apart = rows.role.isin(["nonlinearity", "oracle"])
        return rows.assign(apart=apart).sort_values(["apart", "accuracy"], ascending=[True, False]).drop(columns="apart")

    def as_text(self) -> str:
        """Return the tables for a terminal."""
        m = self.manifest
        lines = [f"grid {m['grid']} ({m['grid_hash']}), {int(self.table.n_all.max() if len(self.table) else 0)} scenarios"]
        for mode in (self.first, RAW if self.first == FRONT else FRONT):
            lines += ["", f"against cycled, {'with' if mode == FRONT else 'without'} the oscillation front end"]
            lines += _text(self.ranking("cycled", mode), self.table[self.table["mode"] == mode])
        if self.table.needs_mv.any() or (self.table.role == "nonlinearity").any():
            lines += ["", "* sees the valve position MV    ~ nonlinearity test, not ranked"]
        lines += ["", *self._dead_band(), "", "labels that disagree", *_plain(self.disagreement)]
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN and infinity become null and "inf"."""
        return {
            "grid": self.manifest["grid"],
            "grid_hash": self.manifest["grid_hash"],
            "scores": _records(self.table),
            "by_axis": _records(self.by_axis),
            "disagreement": _records(self.disagreement),
        }

    def write(self, folder: str | Path) -> None:
        """Write scores.csv and scores_by_axis.csv."""
        for name, frame in (("scores", self.table), ("scores_by_axis", self.by_axis)):
            with whole_file(Path(folder) / f"{name}.csv") as f:
                frame.to_csv(f, index=False, float_format="%.5g", lineterminator="\n")

    def _dead_band(self) -> list[str]:
        rows = self.by_axis[(self.by_axis.axis == "S_over_2J") & (self.by_axis["mode"] == self.first)]
        rows = rows[(rows.value == "inf") & (rows.positives > 0)]
        if rows.empty:
            return ["no dead-band cell cycles here"]
        found = ", ".join(f"{r.method} {1 - r.miss - r.missing:.2f}" for r in rows.itertuples())
        return [f"dead-band alone ({int(rows.positives.iloc[0])} cycling): found by {found}"]


def score_run(folder: str | Path, raw: bool = False) -> Scores:
    """Score a finished run.

    Parameters
    ----------
    folder : str or Path
        Of the run.
    raw : bool
        Show the scores without the oscillation front end first.

    Returns
    -------
    Scores

    Raises
    ------
    RunError
        When there is no finished run.
    """
    return score_book(Book.read(folder), raw)


def score_book(book: Book, raw: bool = False) -> Scores:
    """Score a run that is in memory; see `score_run`."""
    import pandas as pd

    rows, by_axis = [], []
    for mode in (FRONT, RAW):
        for truth in TRUTHS:
            rows += _rows(book, mode, truth, np.ones(book.ids.size, dtype=bool), interval=True)
        for axis in AXES:
            for value, chosen in axis_values(book, axis):
                for row in _rows(book, mode, "cycled", chosen, interval=False):
                    by_axis.append({"axis": axis, "value": value, **row})
    return Scores(pd.DataFrame(rows), pd.DataFrame(by_axis), _disagreement(book), book.manifest, RAW if raw else FRONT)


def axis_values(book: Book, axis: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield every value of an axis as text, in order, with the scenarios that have it."""
    values = book.axes[axis]
    if values.dtype.kind == "f":
        for value in np.unique(values[~np.isnan(values)]):
            yield f"{value:g}", values == value
    else:
        for value in np.unique(values[values != ""]):
            yield str(value), values == value


def _rows(book: Book, mode: str, truth: str, chosen: np.ndarray, interval: bool) -> Iterator[dict[str, Any]]:
    use = chosen & (book.truth[truth] >= 0)
    positive = book.truth[truth][use] == 1
    verdicts, scores = (book.verdict, book.score) if mode == FRONT else (book.verdict_raw, book.score_raw)
    n, p = int(use.sum()), int(positive.sum())
    if n == 0:
        return
    for i, method in enumerate(book.methods):
        said = verdicts[i, use]
        right, undecided = int((said == positive).sum()), int((said == 2).sum())
        false_alarms, misses = int((said[~positive] == 1).sum()), int((said[positive] == 0).sum())
        counts = ((right, n), (right, n - undecided), (undecided, n), (false_alarms, n - p), (misses, p))
        about = book.manifest["methods"][method]
        row: dict[str, Any] = {
            "method": method,
            "truth": truth,
            "mode": mode,
            "role": about["role"],
            "needs_mv": about["needs_mv"],
            "n": n,
            "n_all": int(chosen.sum()),
            "positives": p,
        }
        for name, (hits, of) in zip(RATES, counts):
            lo, hi = wilson(hits, of)
            row[name] = hits / of if of else math.nan
            row[f"{name}_lo"], row[f"{name}_hi"] = float(lo), float(hi)
        row["missing"] = float((said[positive] == 2).mean()) if p else math.nan  # positives without a decision
        score = scores[i, use]
        known = ~np.isnan(score)
        row["scored"] = int(known.sum())
        if interval:
            row["auc"], row["auc_lo"], row["auc_hi"] = auc(score[known], positive[known])
        else:
            row["auc"] = _area(score[known], positive[known])
        row["errors"] = int(book.failed[i, use].sum())
        row["median_ms"] = round(1e3 * float(np.median(book.runtime[i, use])), 4)
        yield row


def _area(score: np.ndarray, positive: np.ndarray) -> float:
    from scipy.stats import rankdata

    m, n = int(positive.sum()), int((~positive).sum())
    if min(m, n) == 0:
        return math.nan
    return float((rankdata(score)[positive].sum() - m * (m + 1) / 2) / (m * n))


def _disagreement(book: Book) -> pd.DataFrame:
    import pandas as pd

    def word(codes: np.ndarray) -> np.ndarray:
        return np.array(["no cell", "no", "yes"])[codes + 1]

    said = {"sticky": word(book.truth["sticky"]), "predicted": word(book.truth["predicted"])}
    frame = pd.DataFrame({**said, "cycled": book.truth["cycled_word"]})
    counts = frame.value_counts(sort=False).rename("scenarios").reset_index()
    return counts.sort_values(["sticky", "predicted", "cycled"], ascending=False, ignore_index=True)


def _text(ranking: pd.DataFrame, all_truths: pd.DataFrame) -> list[str]:
    other = {(r.method, r.truth): r.accuracy for r in all_truths.itertuples()}
    head = ("method", "accuracy", "95 %", "decided", "undecided", "false al.", "miss", "AUC", "sticky", "predicted", "ms")
    lines = [head]
    for r in ranking.itertuples():
        mark = ("*" if r.needs_mv else "") + ("~" if r.role == "nonlinearity" else "")
        # the last two columns: accuracy against the other truths
        lines.append(
            (
                f"{r.method}{mark}",
                f"{r.accuracy:.3f}",
                f"{r.accuracy_lo:.3f}-{r.accuracy_hi:.3f}",
                *(_short(x) for x in (r.decided, r.no_decision, r.false_alarm, r.miss, r.auc)),
                _short(other.get((r.method, "sticky"), math.nan)),
                _short(other.get((r.method, "predicted"), math.nan)),
                f"{r.median_ms:.2f}",
            )
        )
    return _columns(lines)


def _short(x: float) -> str:
    return "-" if math.isnan(x) else f"{x:.3f}"


def _plain(frame: pd.DataFrame) -> list[str]:
    return _columns([tuple(frame.columns), *(tuple(map(str, row)) for row in frame.itertuples(index=False))])


def _columns(lines: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    return ["  ".join(cell.ljust(w) for cell, w in zip(line, widths)).rstrip() for line in lines]


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return json.loads(frame.to_json(orient="records", double_precision=6))
