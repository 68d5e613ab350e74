"""Does the conclusion hold on real loops? `python -m results.studies.plant.real_loops FOLDER ...`
lists every loop with its label and the conclusion, and counts each kind of label apart.

A folder holds records and `records.csv`. A loop has the mean log-odds of its records. No number of
the product was fitted to these loops, but rules were chosen while looking at them: what leaves out
the contributor whose loops matter most is given as well.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from joblib import Parallel, delayed

from simbench.bench.statistics import rate
from simbench.detectors.errors import UserError
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.detectors.views import columns
from simbench.gap import conclude
from simbench.gap.stiction.conclusion import WORDS, Conclusion, group_conclusions, without
from simbench.gap.thresholds import LIKELIER
from simbench.usage import exit_code

# how sure a label is: who contributed the loop names the cause; he writes that it is likely, or a
# folder of his says so; nobody states a cause
TIERS = {
    "stated": "stated",
    "likely": "likely",
    "author_folder": "likely",
    "unverified": "unverified",
    "inferred": "unverified",
    "none": "unverified",
}
# what papers state of the International Stiction Data Base: right, of how many loops. None of them
# lists its loops where it could be read here, so no loop can be compared.
PUBLISHED = (("Damarla 2026, arXiv 2607.22486: optimal transport images", 18, 20),)


def asked(file: Path) -> Conclusion:
    """Return the conclusion about a record, or that it cannot be judged."""
    warnings.simplefilter("ignore")
    try:
        return conclude(file)
    except UserError as why:
        return without(str(why), [])


def read(folders: Sequence[Path]) -> pd.DataFrame:
    """Return one row a record of all folders, with its label; one that is in two folders counts
    where it comes first.
    """
    listed = [pd.read_csv(f / "records.csv").assign(folder=str(f)) for f in folders]
    rows = pd.concat(listed).drop_duplicates("id")
    rows = rows.loc[[(Path(f) / f"{i}.csv").exists() for f, i in zip(rows.folder, rows.id)]]
    rows["contributor"] = [
        source.split(":")[0] if tier != "author_folder" and ":" in source else origin.split(" ")[0]
        for source, tier, origin in zip(rows.label_source.fillna(""), rows.label_tier, rows.source)
    ]
    rows["tier"] = rows.label_tier.map(TIERS)
    return rows.reset_index(drop=True)


def by_loop(records: pd.DataFrame, key: str = "loop") -> pd.DataFrame:
    """Return one row a loop (or unit) and label, with the probability and verdict of its
    records.
    """
    conclusions, labels = dict(zip(records.id, records.conclusion)), records.set_index("id")
    groups = group_conclusions(conclusions, labels.to_dict("index"), key)
    firsts = records.groupby([key, "label"], sort=False)[["tier", "contributor"]].first()
    return pd.DataFrame([
        {"loop": loop, "label": label, "records": n, "p": p, "verdict": answer}
        | firsts.loc[(loop, label)].to_dict()
        for (loop, label), (n, p, answer) in groups.items()
    ])  # fmt: skip


def area(table: pd.DataFrame) -> float:
    """Return the area under the ROC curve; a loop that cannot be judged has even odds."""
    from sklearn.metrics import roc_auc_score

    known = table[table.label != "unknown"]
    p = known.p.astype(float).fillna(LIKELIER)
    return float(roc_auc_score(known.label == STICTION, p))


def share(count: int, of: int) -> str:
    """Return a count of so many, with the 95 % interval of its share."""
    if not of:
        return "0 of 0"
    interval = rate(count, of)
    return f"{count} of {of} ({interval.lo:.2f} to {interval.hi:.2f})"


def counted(table: pd.DataFrame) -> list[str]:
    """Return of each kind of label how many loops were answered how."""
    head = ("label", "loops", "stiction", "no stiction", "cannot tell")
    rows = [head]
    for tier in dict.fromkeys(TIERS.values()):
        for sticks in (True, False):
            here = table[
                (table.tier == tier)
                & (table.label != "unknown")
                & ((table.label == STICTION) == sticks)
            ]
            said = [
                share(int((here.verdict == v).sum()), len(here))
                for v in (STICTION, NO_STICTION, NO_DECISION)
            ]
            what = "stiction" if sticks else "no stiction"
            rows.append((f"{what}, {tier}", str(len(here)), *said))
    return columns(rows)


def without_one(table: pd.DataFrame) -> str:
    """Return the area under the ROC curve without the contributor who matters most, either way."""
    known = table[table.label != "unknown"]
    left = {}
    for c in known.contributor.unique():
        rest = known[known.contributor != c]
        if rest.label.eq(STICTION).any() and rest.label.ne(STICTION).any():
            left[c] = area(rest)
    if not left:
        return "no contributor can be left out"
    low, high = min(left, key=lambda c: left[c]), max(left, key=lambda c: left[c])
    return f"{left[low]:.2f} (without {low}) to {left[high]:.2f} (without {high})"


def as_lines(records: pd.DataFrame) -> list[str]:
    """Return the table of loops, the counts, and the areas under the ROC curve."""
    loops = by_loop(records)
    shown = loops.assign(order=loops.p.astype(float).fillna(-1.0)).sort_values(
        "order", ascending=False, kind="stable"
    )
    rows = [("loop", "label", "contributor", "records", "P(stiction)", "conclusion")]
    rows += [
        (
            r.loop, f"{r.label.replace('_', ' ')}, {r.tier}", r.contributor, str(r.records),
            "" if pd.isna(r.p) else f"{r.p:.2f}", WORDS[r.verdict],
        )
        for r in shown.itertuples()
    ]  # fmt: skip
    known = records[records.label != "unknown"]
    units = by_loop(records, "unit_group")
    lines = [*columns(rows), "", "Loops by how sure their label is, with 95 % intervals:"]
    lines += [*counted(loops), ""]
    lines += [
        f"Area under the ROC curve: {area(known):.3f} by record ({len(known)}),"
        f" {area(loops):.3f} by loop ({int((loops.label != 'unknown').sum())}),"
        f" {area(units):.3f} by unit ({int((units.label != 'unknown').sum())}).",
        f"By unit and without one contributor: {without_one(units)}.",
        "",
        "Published on parts of the International Stiction Data Base (which loops, is not stated):",
    ]
    return lines + [f"  {share(right, of)} right: {what}" for what, right, of in PUBLISHED]


def main(arguments: list[str] | None = None) -> int:
    """Ask of every record and print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.real_loops", description=__doc__
    )
    parser.add_argument("folder", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("-j", type=int, default=2, metavar="JOBS", help="Records at once [2].")
    given = parser.parse_args(arguments)
    rows = read(given.folder)
    files = [Path(f) / f"{i}.csv" for f, i in zip(rows.folder, rows.id)]
    answers: list[Any] = list(Parallel(n_jobs=given.j)(delayed(asked)(file) for file in files))
    probabilities = [c.probability for c in answers]
    print("\n".join(as_lines(rows.assign(conclusion=answers, p=probabilities))))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
