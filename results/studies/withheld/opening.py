"""Open a withheld folder: check the commitment, score the answers, and write tables and the
confusion matrix.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from results.studies.withheld.answering import COST
from results.studies.withheld.claims import true_shrinkages
from results.studies.withheld.files import write_whole
from results.studies.withheld.levels import Figure, Share, by_effect, levels, median, rank, share
from results.studies.withheld.picture import confusion, draw
from results.studies.withheld.score import judge_record, true_circumstances
from results.studies.withheld.truth import OPEN_ANSWERS, read_any, rows_of
from results.studies.worlds import NAMES
from simbench.detectors.errors import ParameterError
from simbench.files import folder as make_folder
from simbench.files import write_table
from simbench.progress import Progress
from simbench.scenarios.toml import read_toml


def open_(
    folder: str | Path,
    key: str | Path | None = None,
    out: str | Path | None = None,
    world: str = NAMES[0],
) -> dict[str, Any]:
    """Score answers/ID.json of a folder against the answers in its key, or against a plain
    answers.csv of someone else.
    """
    folder = Path(folder)
    out = Path(out) if out is not None else folder / "score"
    text, commitment = read_any(folder, Path(key) if key is not None else None)
    truth = rows_of(text)
    judged, claims = [], []
    for row in Progress(truth, desc="scored", delay=1.0):
        record, baseline = record_of(folder, row["id"])
        here = true_circumstances(row, baseline, record)
        answer = answer_of(folder / "answers" / f"{row['id']}.json")
        judged.append(judge_record(row, answer, here))
        if judged[-1]["kind"] == "single" and row.get("case") and answer is not None:
            claims += [
                {"id": row["id"], **c}
                for c in true_shrinkages(
                    row, answer, record, baseline, here, row.get("world") or world
                )
            ]
    table = pd.DataFrame(judged)
    figures = levels(table) + _claim_figures(pd.DataFrame(claims)) + _cost(folder)
    effects = by_effect(table)
    score = {
        "commitment": commitment,
        "records": len(table),
        "answered": int(table.answered.sum()),
        "kinds": {str(k): int(n) for k, n in table.kind.value_counts().items()},
        "figures": [f.row() for f in figures],
        "by_effect": json.loads(effects.to_json(orient="records")),
    }
    make_folder(out)
    for name, content in ((OPEN_ANSWERS, text), ("score.json", json.dumps(score, indent=1))):
        write_whole(out / name, content)
    for name, frame in (
        ("score", pd.DataFrame(score["figures"])),
        ("by_effect", effects),
        ("records", table),
    ):
        write_table(frame, out / f"{name}.csv")
    draw(confusion(table), out)
    return score | {"markdown": markdown(figures, effects)}


def markdown(figures: list[Share | Figure], effects: pd.DataFrame | None) -> str:
    """Return the score as markdown tables; without `effects` the figures alone."""
    lines = [
        "| figure (medium and strong) | value | 95 % interval | n | level | holds |",
        "|---|---|---|---|---|---|",
    ]
    for f in figures:
        value = "-" if f.value is None else f"{f.value:.3f}"
        interval = "[{:.2f}, {:.2f}]".format(*f.interval) if isinstance(f, Share) and f.n else ""
        level = "" if f.level is None else f"{'<=' if f.at_most else '>='} {f.level:g}"
        holds = "" if f.holds is None else "yes" if f.holds else "NO"
        lines.append(f"| {f.name} | {value} | {interval} | {f.n} | {level} | {holds} |")
    for measure, title in (
        ("first", "first answer right"),
        ("in_group", "right within its group"),
        ("block_right", "block right"),
    ):
        if effects is None:
            break
        part = effects[effects.measure == measure]
        order = [s for s in ("weak", "medium", "strong") if s in set(part.strength)]
        order += sorted(set(part.strength) - set(order))
        lines += ["", f"| {title} | " + " | ".join(order) + " |", "|---" * (len(order) + 1) + "|"]
        for effect, rows in part.groupby("effect", sort=False):
            cells = {
                r["strength"]: f"{r['k']}/{r['n']} [{r['lo']:.2f}, {r['hi']:.2f}]"
                for r in rows.to_dict("records")
            }
            lines.append(f"| {effect} | " + " | ".join(cells.get(s, "") for s in order) + " |")
    return "\n".join(lines) + "\n"


def record_of(folder: Path, name: str) -> tuple[pd.DataFrame, Mapping[str, Any]]:
    """Return a record of a withheld folder, and its baseline."""
    path = folder / "records" / f"{name}.csv"
    try:
        frame = pd.read_csv(path)
    except OSError as error:
        raise ParameterError(
            f"withheld: {path} cannot be read: {error.strerror}; a file of the check is needed"
        ) from None
    frame.columns = [str(c).strip().lower() for c in frame.columns]
    frame = frame.dropna(axis="columns", how="all").ffill().bfill()
    missing = [c for c in ("op", "pv") if c not in frame]
    if missing:
        raise ParameterError(
            f"withheld: {path} has no {missing[0].upper()}; its columns are"
            f" {', '.join(frame.columns)}"
        )
    return frame, read_toml(path.with_suffix(".toml"))


def answer_of(path: Path) -> dict[str, Any] | None:
    """Return the product's answer about a record; None where there is none."""
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except ValueError:
        raise ParameterError(f"withheld: {path} is no JSON; delete it and answer again") from None
    return answer if isinstance(answer, dict) else None


def _claim_figures(claims: pd.DataFrame) -> list[Share | Figure]:
    if len(claims) < 3:
        return []
    best = claims.groupby(["id", "right"]).true.max().unstack().reindex(columns=[True, False])
    return [
        rank(
            "re-simulated shrinkage of candidates: rank correlation with claimed",
            claims.claimed,
            claims.true,
            0.8,
        ),
        median("re-simulated shrinkage of the true group, median", best[True]),
        median("re-simulated shrinkage of the best wrong group, median", best[False]),
        share(
            "90 % interval of the claim covers the re-simulated shrinkage", claims.covered.dropna()
        ),
    ]


def _cost(folder: Path) -> list[Figure]:
    path = folder / COST
    if not path.exists():
        return []
    cost = pd.read_csv(path).cpu_s
    mean = Figure("CPU-seconds per record, mean", float(cost.mean()), len(cost))
    return [mean] if len(cost) else []
