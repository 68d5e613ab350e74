"""The diagnosis on labelled plant records without a baseline: `python -m simbench.gap.plant_data FOLDER`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from detectors.errors import UserError
from detectors.io import read_record
from simbench.gap.diagnosis import diagnose

FRICTION = {"stiction", "deadband"}


def diagnose_folder(folder: str | Path) -> pd.DataFrame:
    """Diagnose every usable primary record of a folder with a `records.csv`, each with `--identify`.

    Parameters
    ----------
    folder : path
        `records.csv` (columns id, unit_group, label, label_doubt, usable, primary, dynamics) and ID.csv files.

    Returns
    -------
    DataFrame
        One row per record: id, unit_group, label, credible (no doubt about the label), effects, friction (named or not),
        error (the sentence of a record that was refused).
    """
    table = pd.read_csv(Path(folder) / "records.csv")
    rows = []
    for m in tqdm(list(table[(table.usable == 1) & (table.primary == 1)].itertuples()), file=sys.stderr, delay=1.0):
        process = str(m.dynamics).replace("_", "-")
        effects, error = [], ""
        try:
            known = {"process": process} if process in ("integrating", "self-regulating") else {}
            record = read_record(Path(folder) / f"{m.id}.csv", **known)
            effects = [e["effect"] for e in diagnose(record, None, bootstrap=False).effects]
        except UserError as problem:
            error = str(problem)
        rows.append(
            {
                "id": m.id,
                "unit_group": m.unit_group,
                "label": m.label,
                "credible": not isinstance(m.label_doubt, str),
                "effects": " ".join(effects),
                "friction": bool(FRICTION & set(effects)),
                "error": error,
            }
        )
    return pd.DataFrame(rows)


def by_unit_group(frame: pd.DataFrame) -> pd.DataFrame:
    """Return, per label, how many unit groups there are and in which share friction was named (mean of each group's share).

    Parameters
    ----------
    frame : DataFrame
        From `diagnose_folder`; only credible labels count.

    Returns
    -------
    DataFrame
        Columns label, groups, share, majority (share of groups in which most records name friction).
    """
    share = frame[frame.credible].groupby(["label", "unit_group"]).friction.mean().reset_index()
    found = share.groupby("label").friction
    table = pd.DataFrame({"groups": found.size(), "share": found.mean(), "majority": found.apply(lambda x: (x >= 0.5).mean())})
    return table.reset_index()


def main(arguments: list[str] | None = None) -> int:
    """Print the table by unit group; write the records' rows where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="CSV of the single records")
    given = parser.parse_args(arguments)
    frame = diagnose_folder(given.folder)
    if given.output is not None:
        frame.to_csv(given.output, index=False)
    print(by_unit_group(frame).to_string(index=False))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
