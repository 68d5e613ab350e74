"""Is stiction found in recorded loops? `python -m results.studies.recorded_loops FOLDER -o KEPT` asks of every labelled one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

from detectors.errors import UserError
from detectors.record import PROCESSES, LoopRecord
from detectors.records.io import read_record
from simbench.bench.statistics import wilson
from simbench.files import answered, folder
from simbench.gap.stiction.friction import FRICTION, friction
from simbench.gap.stiction.pace import resampled
from simbench.plant.indices import judged
from simbench.plant.trust.calibration import ASKED, EvidenceWeights, calls
from simbench.plant.trust.candidate_loops import in_percent
from simbench.plant.trust.trust import LIKELY
from simbench.usage import exit_code


def every(k: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what keeps every k-th sample."""
    return lambda r: resampled(r, lambda x: x[::k], k)


def mean_of(k: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what keeps the mean of k samples."""
    return lambda r: resampled(r, lambda x: x[: x.size // k * k].reshape(-1, k).mean(axis=1), k)


def held(k: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what holds PV for k samples."""
    return lambda r: replace(r, pv=np.repeat(r.pv[::k], k)[: r.n])


def exception(share: float) -> Callable[[LoopRecord], LoopRecord]:
    """Return what keeps of PV and OP only changes beyond a share of their range, with straight lines between."""
    return lambda r: replace(r, pv=_exception(r.pv, share), op=_exception(r.op, share))


def lattice(steps: int) -> Callable[[LoopRecord], LoopRecord]:
    """Return what rounds PV to so many steps of its range."""

    def rounded(r: LoopRecord) -> LoopRecord:
        unit = _span(r.pv) / steps
        return replace(r, pv=np.round(r.pv / unit) * unit)

    return rounded


PANEL: dict[str, Callable[[LoopRecord], LoopRecord]] = {
    "every 2nd sample": every(2), "every 3rd sample": every(3), "every 5th sample": every(5),
    "mean of 2": mean_of(2), "mean of 3": mean_of(3), "PV held for 2": held(2), "PV held for 4": held(4),
    "exception 0.5 %": exception(0.005), "exception 1 %": exception(0.01), "exception 2 %": exception(0.02),
    "lattice of 100": lattice(100), "lattice of 50": lattice(50),
}  # fmt: skip


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
    """Return what a record's verdict and likelihood say.

    Parameters
    ----------
    record : LoopRecord

    Returns
    -------
    dict
        procedure (says stiction), likelihood (friction fits better, None where no loop can be identified), trust (probability
        above `LIKELY`).
    """
    said = calls(judged(record, [ASKED]))
    try:
        gain = friction(in_percent(record)[0]).log_likelihood_gains[FRICTION]
    except UserError:
        return {ASKED: said, "likelihood": None, "trust": False}
    return {ASKED: said, "likelihood": gain > 0, "trust": EvidenceWeights.read().probability(gain, said) > LIKELY}


def counted(rows: pd.DataFrame, method: str) -> list[str]:
    """Return found and false alarms of one method, by record and by unit (most of its records).

    Parameters
    ----------
    rows : DataFrame
        Columns sticky, unit, and one per method.
    method : str

    Returns
    -------
    list of str
    """
    out = []
    called = rows.assign(called=rows[method].fillna(value=False).astype(bool))
    units = called.groupby(["unit", "sticky"]).called.mean().gt(0.5).reset_index()
    for what, table in (("records", called), ("units", units)):
        text = f"{method:<12} by {what:<8}"
        for kind, name in ((True, "found"), (False, "false alarms")):
            here = table[table.sticky == kind].called
            lo, hi = wilson(here.sum(), here.size) if here.size else (0.0, 1.0)
            text += f" {name} {here.sum()} of {here.size} ({lo:.2f} to {hi:.2f})"
        out.append(text)
    return out


def records(where: Path) -> list[tuple[Any, LoopRecord]]:
    """Return the usable primary records whose label nobody doubts, each with its line of `records.csv`.

    Parameters
    ----------
    where : Path
        `records.csv` (columns id, unit_group, label, label_doubt, usable, primary, dynamics) and ID.csv files.

    Returns
    -------
    list of (line, LoopRecord)
    """
    table = pd.read_csv(where / "records.csv")
    good = table[(table.usable == 1) & (table.primary == 1) & table.label_doubt.isna() & (table.label != "unknown")]
    out = []
    for line in good.itertuples():
        process = str(line.dynamics).replace("_", "-")
        out.append((line, read_record(where / f"{line.id}.csv", **({"process": process} if process in PROCESSES else {}))))
    return out


def main(arguments: list[str] | None = None) -> int:
    """Weigh every record, and one per unit once an archive has had it in twelve ways; goes on where it stopped."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.recorded_loops", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="Folder where the answers are kept.")
    parser.add_argument("--panel", action="store_true", help="also as an archive would have changed the first record of a unit")
    given = parser.parse_args(arguments)
    folder(given.output)
    read = records(given.folder)
    rows = pd.DataFrame(
        {"unit": m.unit_group, "sticky": m.label == "stiction", **answered(given.output / f"{m.id}.json", partial(weighed, r))}
        for m, r in tqdm(read, file=sys.stderr)
    )
    print("\n".join(line for method in (ASKED, "likelihood", "trust") for line in counted(rows, method)))
    if given.panel:
        first = list(dict(reversed([((m.unit_group, m.label), (m, r)) for m, r in read])).values())
        print("\n".join(_panel(first, given.output)))
    return 0


def _panel(chosen: list[tuple[Any, LoopRecord]], out: Path) -> list[str]:
    added: list[str] = []
    sound = lost = 0
    for m, r in tqdm(chosen, file=sys.stderr):
        before = answered(out / f"{m.id}.json", partial(weighed, r))["trust"]
        for i, (name, change) in enumerate(PANEL.items()):
            after = answered(out / f"{m.id}-{i}.json", partial(weighed, change(r)))["trust"]
            lost += before and not after
            if after and not before:
                added.append(f"added: {m.id}, {m.label}, {name}")
                sound += m.label != "stiction"
    said = f"{len(added)} confident verdicts of stiction added, {sound} of them where the label says none; {lost} lost"
    return ["", f"{len(chosen)} records changed in {len(PANEL)} ways: {said}", *added]


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
