"""The diagnosis on labelled plant records without a baseline: `python -m
results.studies.plant.plant_data FOLDER`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from simbench.detectors.errors import UserError
from simbench.detectors.record import PROCESSES
from simbench.detectors.records.io import read_record
from simbench.gap.diagnosis import diagnose
from simbench.progress import Progress
from simbench.usage import exit_code

FRICTION = {"stiction", "deadband"}

# how a flag of records.csv is called in the report: as an effect, or at the head of a note
FLAGS = {
    "pv_quantised": ("quantisation", "data quality: quantised_pv"),
    "compressed": ("compression", "data quality: compressed"),
    "spikes": ("outliers", "data quality: spikes"),
    "sp_steps": ("set-point steps",),
}


def diagnose_folder(folder: str | Path, blind: bool = False) -> pd.DataFrame:
    """Diagnose every usable primary record of a folder with a `records.csv`, each with
    `--identify`.

    Parameters
    ----------
    folder : path
        `records.csv` (columns id, unit_group, label, label_doubt, usable, primary, dynamics) and
        ID.csv files.
    blind : bool
        Do not tell the diagnosis whether the plant integrates.

    Returns
    -------
    DataFrame
        One row per record: id, unit_group, label, credible (no doubt about the label), effects,
        friction (named or not), error (the sentence of a record that was refused), type (of the
        plant), and for each of `FLAGS` the flag and `named_` flag: whether an effect or a note
        states so.
    """
    table = pd.read_csv(Path(folder) / "records.csv")
    table["sp_steps"] = table.sp_kind == "steps"
    rows = []
    for m in Progress(
        list(table[(table.usable == 1) & (table.primary == 1)].itertuples()),
        delay=1.0,
    ):
        process = str(m.dynamics).replace("_", "-")
        effects, notes, error, kind = [], set(), "", ""
        try:
            known = {"process": process} if process in PROCESSES and not blind else {}
            report = diagnose(read_record(Path(folder) / f"{m.id}.csv", **known), None)
            effects = [e["effect"] for e in report.effects]
            notes = {
                *effects,
                *(
                    word
                    for words in FLAGS.values()
                    for word in words
                    if any(n.startswith(f"{word}: ") for n in report.notes)
                ),
            }
            kind = report.behind.found.situation.baseline.plant.type
        except UserError as problem:
            error = str(problem)
        row = {
            "id": m.id,
            "unit_group": m.unit_group,
            "label": m.label,
            "credible": not isinstance(m.label_doubt, str),
            "effects": " ".join(effects),
            "friction": bool(FRICTION & set(effects)),
            "error": error,
            "type": kind,
        }
        for flag, words in FLAGS.items():
            row |= {flag: bool(getattr(m, flag)), f"named_{flag}": bool(notes & set(words))}
        rows.append(row)
    return pd.DataFrame(rows)


def by_unit_group(frame: pd.DataFrame) -> pd.DataFrame:
    """Return, per label, how many unit groups there are and in which share friction was named (mean
    of each group's share).

    Parameters
    ----------
    frame : DataFrame
        From `diagnose_folder`; only credible labels count.

    Returns
    -------
    DataFrame
        Columns label, groups, share, majority (share of groups in which most records name
        friction).
    """
    share = frame[frame.credible].groupby(["label", "unit_group"]).friction.mean().reset_index()
    groups = share.groupby("label").friction
    table = pd.DataFrame(
        {
            "groups": groups.size(),
            "share": groups.mean(),
            "majority": groups.apply(lambda x: (x >= 0.5).mean()),
        }
    )
    return table.reset_index()


def by_flag(frame: pd.DataFrame) -> pd.DataFrame:
    """Return, per flag of records.csv, how often it is there and named, and how often it is named
    without being there.

    Parameters
    ----------
    frame : DataFrame
        From `diagnose_folder`.

    Returns
    -------
    DataFrame
        Columns flag, records, named, groups, groups_named (in most of the group's flagged records),
        others, others_named.
    """
    rows = []
    for flag in FLAGS:
        has, named = frame[frame[flag]], f"named_{flag}"
        groups = has.groupby("unit_group")[named].mean().to_numpy(dtype=float) >= 0.5
        others = frame[~frame[flag]]
        counts = (
            len(has),
            has[named].sum(),
            groups.size,
            groups.sum(),
            len(others),
            others[named].sum(),
        )
        rows.append((flag, *map(int, counts)))
    return pd.DataFrame(
        rows,
        columns=["flag", "records", "named", "groups", "groups_named", "others", "others_named"],
    )


def main(arguments: list[str] | None = None) -> int:
    """Print friction by unit group and the flags' table; write the records' rows where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="CSV of the single records")
    parser.add_argument("--blind", action="store_true", help="do not say which plants integrate")
    given = parser.parse_args(arguments)
    frame = diagnose_folder(given.folder, given.blind)
    if given.output is not None:
        frame.to_csv(given.output, index=False)
    print(by_unit_group(frame).to_string(index=False))
    print(by_flag(frame).to_string(index=False))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
