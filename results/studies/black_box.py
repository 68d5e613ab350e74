"""How near are simulations of identified loops to records, beside a black box? `python -m
results.studies.black_box FOLDER...` prints the answers of `simbench gap diagnose FOLDER...
--identify`, and below them how often a black box is near.

The black box stands beside the diagnosis as `no_waveform` stands beside the detectors: regressions
of OP's changes and of PV on their past, what both leave drawn again in pieces of a third of the
swing's period, no valve, no archive and no choice. What it reaches needs no knowledge of loops.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from joblib import delayed

from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder
from simbench.detectors.repaired import repair_record
from simbench.detectors.views import columns
from simbench.gap.closed_loop.copies import archived, copies
from simbench.gap.closed_loop.gap import measure, simulate_runs, within_reach
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import identify
from simbench.parallel import run_parallel
from simbench.usage import exit_code


class Box(NamedTuple):
    """How far simulations of the black box are from a record, and parts of the record from each
    other.
    """

    distance: float
    plant_floor: float


def black_box(record: LoopRecord) -> Box | None:
    """Return how far the black box of a record is from it; None where it has none."""
    try:
        with one_thread():
            repaired = repair_record(record)
            loop = identify(repaired)
            s = check(repaired, loop, trusted=False)
            boxes = [c.loop for c in copies(s, loop, []) if c.plant != "first order"]
            runs = simulate_runs(s, archived(boxes[0], s, held=False), 0) if boxes else None
    except UserError:
        return None
    if runs is None:
        return None
    found = measure(s, runs, runs, runs)
    return Box(found.before, found.plant_floor)


def main(words: Sequence[str] | None = None) -> int:
    """Print the answers and the black box."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("folders", nargs="+")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    asked = parser.parse_args(words)
    records: dict[str, LoopRecord] = {}
    for folder in asked.folders:
        records |= read_folder(folder)[0]

    # the diagnosis of every record that it does not refuse, and the black box of the same
    calls = [delayed(_gap_of)(record) for record in records.values()]
    answers = dict(zip(records, run_parallel(calls, asked.jobs, "diagnosed"), strict=True))
    gaps = {name: gap for name, gap in answers.items() if gap is not None}
    calls = [delayed(black_box)(records[name]) for name in gaps]
    boxes = dict(zip(gaps, run_parallel(calls, asked.jobs, "black boxes"), strict=True))
    print("\n".join(compared(gaps, boxes)))
    return 0


def _gap_of(record: LoopRecord) -> dict[str, float] | None:
    """Return the gap of a diagnosis of the identified loop; None where it is refused."""
    try:
        return diagnose(record, identify=True).as_json()["gap"]
    except UserError:
        return None


def compared(gaps: dict[str, dict[str, float]], boxes: dict[str, Box | None]) -> list[str]:
    """Return how often diagnosis and black box are near, and both distances of every record."""
    near = {
        "the plain loop": [
            within_reach(gap["before"], gap["plant_floor"]) for gap in gaps.values()
        ],
        "the diagnosis": [within_reach(gap["after"], gap["plant_floor"]) for gap in gaps.values()],
        "the black box": [
            box is not None and within_reach(box.distance, box.plant_floor)
            for box in (boxes[name] for name in gaps)
        ],
    }
    lines = [f"Near of {len(gaps)} records:"]
    lines += [f"  {name:14s} {np.mean(each):.2f}" for name, each in near.items()]
    rows = [
        (
            name,
            f"{gap['after']:.2f}",
            f"{gap['plant_floor']:.2f}",
            *(("", "") if (box := boxes[name]) is None else (f"{x:.2f}" for x in box)),
        )
        for name, gap in gaps.items()
    ]
    return [*lines, "", *columns([("record", "after", "plant", "black box", "its plant"), *rows])]


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
