"""Is stiction detected in recorded loops? `python -m results.studies.plant.recorded_loops FOLDER -o
KEPT` asks of every label.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from results.studies.plant.answers import answered
from simbench.bench.statistics import wilson
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import PROCESSES, LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.verdict import STICTION
from simbench.files import folder
from simbench.gap.stiction.deniable import resample_record
from simbench.gap.stiction.friction import friction
from simbench.gap.stiction.probability import pool_log_odds, probability
from simbench.gap.thresholds import CLAIMED_FROM
from simbench.progress import Progress
from simbench.usage import exit_code


def every(k: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what keeps every k-th sample."""
    return lambda r: resample_record(r, lambda x: x[::k], k)


def mean_of(k: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what keeps the mean of k samples."""
    return lambda r: resample_record(
        r, lambda x: x[: x.size // k * k].reshape(-1, k).mean(axis=1), k
    )


def held(k: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what holds PV for k samples."""
    return lambda r: replace(r, pv=np.repeat(r.pv[::k], k)[: r.n])


def exception(share: float) -> Callable[[LoopRecord], LoopRecord]:
    """Return what keeps of PV and OP only changes beyond a share of their range, with straight
    lines between.
    """
    return lambda r: replace(r, pv=_exception(r.pv, share), op=_exception(r.op, share))


def lattice(steps: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what rounds PV to so many steps of its range."""

    def rounded(r: LoopRecord) -> LoopRecord:
        unit = _span(r.pv) / steps
        return replace(r, pv=np.round(r.pv / unit) * unit)

    return rounded


PROCEDURE, LIKELIHOOD = "procedure", "likelihood"
PANEL: dict[str, Callable[[LoopRecord], LoopRecord]] = {
    "every 2nd sample": every(2),
    "every 3rd sample": every(3),
    "every 5th sample": every(5),
    "mean of 2": mean_of(2),
    "mean of 3": mean_of(3),
    "PV held for 2": held(2),
    "PV held for 4": held(4),
    "exception 0.5 %": exception(0.005),
    "exception 1 %": exception(0.01),
    "exception 2 %": exception(0.02),
    "lattice of 100": lattice(100),
    "lattice of 50": lattice(50),
}


def _span(x: np.ndarray) -> float:
    return float(np.quantile(x, 0.99) - np.quantile(x, 0.01)) or 1.0


def _exception(x: np.ndarray, share: float) -> np.ndarray:
    band, kept = share * _span(x), [0]
    for i in range(1, x.size - 1):
        if abs(x[i] - x[kept[-1]]) > band:
            kept.append(i)
    kept.append(x.size - 1)
    return np.interp(np.arange(x.size), kept, x[kept])


def weighed(record: LoopRecord) -> dict[str, Any]:
    """Return whether the procedure reports stiction, and the log-odds of it; None where the record
    cannot be judged.
    """
    verdict = judge(record, [PROCEDURE])[0].verdict == STICTION
    try:
        return {PROCEDURE: verdict, "odds": friction(record).log_odds}
    except UserError:
        return {PROCEDURE: verdict, "odds": None}


def counted(rows: pd.DataFrame, method: str) -> list[str]:
    """Return detections and false alarms of one method, by record, by loop and by unit.

    A loop or unit is called by most of its records, by the likelihood from their pooled log-odds.
    """
    out = []
    for what in ("record", "loop", "unit"):
        keys = [rows.index] if what == "record" else [rows[what], rows.sticky]
        table = pd.DataFrame(
            {"sticky": bool(part.sticky.iloc[0]), "called": _called(part, method)}
            for _, part in rows.groupby(keys)
        )
        text = f"{method:<12} by {what:<7}"
        for kind, name in ((True, "found"), (False, "false alarms")):
            here = table[table.sticky == kind].called
            lo, hi = wilson(here.sum(), here.size) if here.size else (0.0, 1.0)
            text += f" {name} {here.sum()} of {here.size} ({lo:.2f} to {hi:.2f})"
        out.append(text)
    return out


def _called(part: pd.DataFrame, method: str) -> bool:
    if method == PROCEDURE:
        return bool(part[PROCEDURE].mean() > 0.5)
    odds = part.odds.dropna()
    return bool(odds.size and probability(pool_log_odds(list(odds))) > CLAIMED_FROM)


def records(where: Path, doubted: bool = False) -> list[tuple[Any, LoopRecord]]:
    """Return the usable primary records of `records.csv`, each with its line; those with a doubted
    label where asked for.
    """
    table = pd.read_csv(where / "records.csv")
    good = table[(table.usable == 1) & (table.primary == 1) & (table.label != "unknown")]
    good = good if doubted else good[good.label_doubt.isna()]
    out = []
    for line in good.itertuples():
        process = str(line.dynamics).replace("_", "-")
        out.append(
            (
                line,
                read_record(
                    where / f"{line.id}.csv",
                    **({"process": process} if process in PROCESSES else {}),
                ),
            )
        )
    return out


def main(arguments: list[str] | None = None) -> int:
    """Weigh every record, and one per unit once an archive has had it in twelve ways; goes on where
    it stopped.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.recorded_loops", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="Folder where the answers are kept."
    )
    parser.add_argument(
        "--doubted", action="store_true", help="also records whose label somebody doubts"
    )
    parser.add_argument(
        "--panel",
        action="store_true",
        help="also as an archive would have changed the first record of a unit",
    )
    given = parser.parse_args(arguments)
    folder(given.output)
    read = records(given.folder, given.doubted)
    rows = pd.DataFrame(
        {"unit": m.unit_group, "loop": m.loop, "sticky": m.label == "stiction"}
        | answered(given.output / f"{m.id}.json", partial(weighed, r))
        for m, r in Progress(read)
    )
    if given.doubted:
        print("\nwith loops whose label somebody doubts (--doubted)")
    print("\n".join(line for method in (PROCEDURE, LIKELIHOOD) for line in counted(rows, method)))
    if given.panel:
        first = list(dict(reversed([((m.unit_group, m.label), (m, r)) for m, r in read])).values())
        print("\n".join(panel(first, given.output)))
    return 0


def panel(chosen: list[tuple[Any, LoopRecord]], out: Path) -> list[str]:
    """Return the confident verdicts of stiction that archives add to records and take from them."""
    added: list[str] = []
    sound = lost = silent = 0
    for m, r in Progress(chosen):
        before = _sure(answered(out / f"{m.id}.json", partial(weighed, r)))
        for i, (name, change) in enumerate(PANEL.items()):
            row = answered(out / f"{m.id}-{i}.json", partial(weighed, change(r)))
            silent += row["odds"] is None
            lost += before and not _sure(row)
            if _sure(row) and not before:
                added.append(f"added: {m.id}, {m.label}, {name}")
                sound += m.label != "stiction"
    sentence = (
        f"{len(added)} confident verdicts of stiction added, {sound} of them where the label says"
        f" none; {lost} lost"
    )
    more = f"; of {silent} of {len(chosen) * len(PANEL)} nothing can be told"
    return ["", f"{len(chosen)} records changed in {len(PANEL)} ways: {sentence}{more}", *added]


def _sure(row: dict[str, Any]) -> bool:
    return row["odds"] is not None and probability(row["odds"]) > CLAIMED_FROM


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
