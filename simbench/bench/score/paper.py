"""Tables of scores as a paper prints them: LaTeX, Markdown, or CSV with every number."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from simbench.bench.score.names import ALL, HOME_MARKS, OF_OSCILLATING
from simbench.bench.store.benchmark import benchmark_text
from simbench.detectors.errors import ParameterError
from simbench.files import csv_text, whole_file

if TYPE_CHECKING:
    from simbench.bench.score.compare import Comparison

PAPER_KINDS = (".tex", ".md", ".csv")
_SHARES = ("cost", "accuracy", "sensitivity", "false_positives", "no_decision")
_ENDS = ("", "_lo", "_hi")


def table_kind(path: str | Path) -> str:
    """Return .tex, .md or .csv, whichever a table's name asks for; refuse another."""
    kind = Path(path).suffix.lower()
    if kind not in PAPER_KINDS:
        raise ParameterError(f"table {path}: .tex, .md or .csv is needed")
    return kind


def ranking_numbers(scores: Any, truth: str = "cycled") -> pd.DataFrame:
    """Return the ranking with every interval; `group`: which rows are ranked with each other, the
    main ones without a name; `shared`: other methods have the same rank.
    """
    rows = scores.rows(truth)
    rows = rows.assign(n=rows["applicable"], failed=rows["errors"])
    shares = []
    for name in _SHARES:
        for end in _ENDS:
            shares.append(f"{name}{end}")
    names = ["group", "rank", "shared", "method", "home", "n", "positives", "failed"] + shares
    return rows.loc[:, names].reset_index(drop=True)


def ranking_text(scores: Any, truth: str = "cycled") -> pd.DataFrame:
    """Return the ranking as a paper prints it: values with their 95 % intervals, = after a rank
    that several methods share.
    """
    rows = []
    for r in ranking_numbers(scores, truth).to_dict("records"):
        if pd.isna(r["rank"]):
            rank = ""
        else:
            rank = f"{r['rank']:.0f}{'=' if r['shared'] else ''}"
        name = r["method"] + HOME_MARKS[r["home"]]
        cells = {"Rank": rank, "Method": name, "n": str(r["n"]), **_format_shares(r, _SHARES)}
        rows.append({"Group": r["group"], **cells})
    return pd.DataFrame(rows)


def along_text(rates: pd.DataFrame) -> pd.DataFrame:
    """Return rates along one axis or two as a paper prints them."""
    axes = axes_of(rates)
    rows = []
    for r in rates.to_dict("records"):
        place = {}
        for name in axes:
            place[name] = r[name]
        rows.append(
            {"Method": r["method"], **place, "n": str(r["n"]), **_format_shares(r, _SHARES[1:])}
        )
    return pd.DataFrame(rows)


def axes_of(rates: pd.DataFrame) -> list[str]:
    """Return the axes along which rates are."""
    return list(rates.columns[1 : list(rates.columns).index("n")])


def pairs_text(comparison: Comparison) -> pd.DataFrame:
    """Return all pairs as a square table, or those of chosen methods as a list."""
    if not comparison.square:
        return comparison.listed()
    return comparison.cells().rename_axis("Method").reset_index()


def caption(scores: Any, truth: str = "cycled") -> str:
    """Return what a ranking is of, in one sentence, with the benchmark's version."""
    about = _of_loops(scores, truth, OF_OSCILLATING, "oscillating loops")
    return (
        f"{about}; 95 % intervals; methods that these loops cannot tell apart share a rank (=); *"
        " fitted on this grid, + on loops like these."
    )


def caption_along(scores: Any, rates: pd.DataFrame, truth: str = "cycled") -> str:
    """Return what rates along axes are of, in one sentence, with the benchmark's version."""
    about = _of_loops(scores, truth, ALL, "loops with a label, oscillating or not")
    return f"{about}; by {' and '.join(axes_of(rates))}; 95 % intervals."


def _of_loops(scores: Any, truth: str, population: str, loops: str) -> str:
    rows = scores.rows(truth, population=population)
    m = scores.manifest
    if len(rows):
        n = int(rows["n"].max())
        positives = int(rows["positives"].max())
    else:
        n = 0
        positives = 0
    return (
        f"Detectors of valve stiction on grid {m['grid']}{benchmark_text(m)}, seed {m.get('seed')}:"
        f" {n} {loops}, {positives} positive (label {truth})"
    )


def write(path: str | Path, numbers: pd.DataFrame, text: pd.DataFrame, about: str) -> None:
    """Write a table: CSV has the numbers, the other kinds the text with what it is about."""
    kind = table_kind(path)
    if kind == ".csv":
        content = csv_text(numbers)
    else:
        content = _format_table(kind, text, about)
    with whole_file(path) as f:
        f.write(content)


def _format_table(kind: str, text: pd.DataFrame, about: str) -> str:
    """Return a table as LaTeX or as Markdown, below what it is about."""
    if kind == ".md":
        return f"{about}\n\n{text.to_markdown(index=False, disable_numparse=True)}\n"
    table = text.to_latex(index=False, escape=True, column_format="l" * text.shape[1])
    return f"% {about}\n% needs the package booktabs\n{table}"


def _format_shares(row: dict[str, Any], names: Sequence[str]) -> dict[str, str]:
    """Return shares as text with their intervals, by the name of their column."""
    cells = {}
    for name in names:
        value, lo, hi = (row[f"{name}{end}"] for end in _ENDS)
        if pd.isna(value):
            said = ""
        else:
            said = f"{value:.2f} [{lo:.2f}, {hi:.2f}]"
        cells[name.replace("_", " ").capitalize()] = said
    return cells
