"""Score diagnoses of other people, beside the product's and beside each other.

A diagnosis is one CSV file with the columns `id`, `effect` and `probability`, and optionally
`block`: a row for each candidate of a record. `effect` is a name of `simbench list effects`, `none`
where nothing is lacking, or `unknown`; the most probable row of a record is its answer. Without
probabilities the order of the rows counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import pandas as pd

from results.studies.withheld.levels import Figure, Share, levels
from results.studies.withheld.opening import answer_of, record_of
from results.studies.withheld.score import judge_record, true_circumstances
from results.studies.withheld.truth import read_any, rows_of
from simbench.bench.statistics import mcnemar
from simbench.detectors.errors import ParameterError, nearest
from simbench.detectors.views import columns
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of
from simbench.progress import Progress

OURS = "simbench"  # the answers in the folder, where there are any
COLUMNS = ("id", "effect")
PAIRS = ("first", "second", "only the first right", "only the second right", "p")
# figures of the blind test that an answer of names and probabilities has
SHOWN = (
    "first answer right",
    "right within its group",
    "among the first three",
    "block right (within group)",
    "valve effects with MV",
    "effect named where there is none",
    "none called unknown",
    "two effects: the first named is one of them",
    "foreign: unknown or the library's name, of the resolvable",
    "known effect called unknown",
    "known effect called none",
    "not answered",
    "expected calibration error",
)


@dataclass(frozen=True)
class Scored:
    """Every diagnosis judged on the same records, in one order."""

    tables: Mapping[str, pd.DataFrame]  # one row a record: the truth, and whether it was met
    sites: pd.Series  # number of the site of each record, NaN where the world has none

    def figures(self) -> pd.DataFrame:
        """Return one row a figure, one column a diagnosis: its value with its 95 % interval."""
        cells = {
            name: {f.name: _written(f) for f in levels(table) if f.name in SHOWN}
            for name, table in self.tables.items()
        }
        return pd.DataFrame(cells).loc[list(SHOWN)].rename_axis("figure").reset_index()

    def pairs(self) -> pd.DataFrame:
        """Return for every two diagnoses how often only one of them is right first, of the records
        with one effect, and the exact McNemar p.
        """
        rows = []
        for names in combinations(self.tables, 2):
            first, second = (self._single(name)["first"] for name in names)
            only = int((first & ~second).sum()), int((second & ~first).sum())
            rows.append((*names, *only, f"{mcnemar(*only):.2g}"))
        return pd.DataFrame(rows, columns=list(PAIRS))

    def by(self, what: str) -> pd.DataFrame:
        """Return the share of records with one effect that are right first, over "effect" or
        "site".
        """
        columns = {}
        for name in self.tables:
            right = self._single(name).assign(site=self.sites).groupby(what)["first"]
            columns[name] = right.agg(lambda hits: f"{hits.sum()} of {hits.size}")
        return pd.DataFrame(columns).rename_axis(what).reset_index()

    def _single(self, name: str) -> pd.DataFrame:
        table = self.tables[name]
        return table.loc[table.kind == "single"]

    def as_text(self) -> str:
        """Return the figures, the pairs, and how far the sites lie apart, as text."""
        one = len(self._single(next(iter(self.tables))))
        parts = ["one effect: medium and strong ones\n" + _text(self.figures())]
        if len(self.tables) > 1:
            title = f"first answer right, on the same {one} records with one effect, weak ones too"
            parts.append(f"{title}\n{_text(self.pairs())}")
        if self.sites.notna().any():
            for name in self.tables:
                shares = self._single(name).groupby(self.sites)["first"].mean()
                low, middle, high = shares.quantile([0.0, 0.5, 1.0])
                parts.append(
                    f"{name}: first answer right by site {low:.2f} to {high:.2f}, median"
                    f" {middle:.2f} of {len(shares)} sites ({one} records)"
                )
        return "\n\n".join(parts)


def read_diagnosis(file: Path, ids: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return what a file answers about each record, in the form of the product's answers.

    Raises
    ------
    simbench.detectors.errors.ParameterError
        For a column that is lacking, and for a record, effect or probability that cannot be.
    """
    try:
        frame = pd.read_csv(file, dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        raise ParameterError(f"{file} cannot be read as CSV: {error}") from None
    frame.columns = [c.strip().lower() for c in frame.columns]
    for column in COLUMNS:
        if column not in frame:
            raise ParameterError(f"{file} lacks the column {column!r}; it has {', '.join(frame)}")
    known, allowed = set(ids), [*EFFECTS, NONE, UNKNOWN]
    for line, row in enumerate(frame.to_dict("records"), start=2):
        if row["id"] not in known:
            raise ParameterError(f"{file}, line {line}: no record is called {row['id']!r}")
        if row["effect"] not in allowed:
            raise ParameterError(
                f"{file}, line {line}: effect {row['effect']!r}: {nearest(row['effect'], allowed)}"
            )
        if row.get("block", "") not in ("", NONE, UNKNOWN, *BLOCKS):
            raise ParameterError(
                f"{file}, line {line}: block {row['block']!r}: {nearest(row['block'], BLOCKS)}"
            )
    if "probability" not in frame:
        frame["probability"] = ""
    stated = frame["probability"]
    frame["p"] = pd.to_numeric(stated, errors="coerce")
    wrong = frame.index[(stated.str.strip() != "") & ~frame.p.between(0.0, 1.0)]
    if wrong.size:
        raise ParameterError(
            f"{file}, line {wrong[0] + 2}: probability {stated[wrong[0]]}; 0 to 1 is allowed"
        )
    ranked = frame.sort_values("p", ascending=False, kind="stable", na_position="last")
    return {str(name): _answer(rows) for name, rows in ranked.groupby("id", sort=False)}


def _answer(rows: pd.DataFrame) -> dict[str, Any]:
    """Return one record's rows, most probable first, as the product's answer has them."""
    ranking = [
        {
            "effect": r["effect"],
            "block": r.get("block") or block_of(r["effect"]),
            "probability": None if pd.isna(r["p"]) else float(r["p"]),
        }
        for r in rows.to_dict("records")
    ]
    first = ranking[0]
    named = [first] if first["effect"] in EFFECTS else []
    return {
        "effect": first["effect"],
        "block": first["block"],
        "effects": named,
        "ranking": ranking,
    }


def score(folder: str | Path, files: Sequence[Path], key: str | Path | None = None) -> Scored:
    """Judge diagnoses by the key of a withheld folder; the product's stands beside them where the
    folder has its answers.
    """
    folder = Path(folder)
    truth = rows_of(read_any(folder, Path(key) if key is not None else None)[0])
    ids = [row["id"] for row in truth]
    names = [file.stem for file in files]
    for name in names:
        if name == OURS or names.count(name) > 1:
            raise ParameterError(
                f"{name}.csv: the name of a file names its diagnosis; {name} stands for another one"
            )
    given = {name: read_diagnosis(file, ids) for name, file in zip(names, files)}
    if (folder / "answers").is_dir():
        there = ((name, answer_of(folder / "answers" / f"{name}.json")) for name in ids)
        given = {OURS: {name: a for name, a in there if a is not None}, **given}
    if not given:
        raise ParameterError(f"{folder} has no answers, and no file of answers is given")
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in given}
    for row in Progress(truth, desc="scored", delay=1.0):
        record, baseline = record_of(folder, row["id"])
        here = true_circumstances(row, baseline, record)
        for name, answers in given.items():
            rows[name].append(judge_record(row, answers.get(row["id"]), here))
    cases = [row["case"] if isinstance(row.get("case"), dict) else {} for row in truth]
    sites = pd.Series([case.get("site") for case in cases], dtype=float)
    return Scored({name: pd.DataFrame(table) for name, table in rows.items()}, sites)


def _written(figure: Share | Figure) -> str:
    if figure.value is None:
        return "-"
    if isinstance(figure, Figure):
        return f"{figure.value:.2f} (n {figure.n})"
    low, high = figure.interval
    return f"{figure.value:.2f} ({low:.2f} to {high:.2f}), n {figure.n}"


def _text(frame: pd.DataFrame) -> str:
    rows = (tuple(map(str, row)) for row in frame.itertuples(index=False))
    return "\n".join(columns([tuple(map(str, frame.columns)), *rows]))
