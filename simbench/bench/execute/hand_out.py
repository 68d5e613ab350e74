"""Write the records of a grid without labels, for programs in any language that judge them."""

from __future__ import annotations

import csv
import os
import shutil
import sys
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from simbench.bench.execute.grid_check import refuse_too_large, refuse_wrong_parts, size_of
from simbench.bench.execute.run import read_plan
from simbench.bench.execute.settle_group import settled
from simbench.detectors.errors import ParameterError, Refusal
from simbench.detectors.record import LoopRecord
from simbench.files import folder as make_folder
from simbench.files import refuse_taken, whole_file
from simbench.loop.part_files import error_text
from simbench.loop.simulate import simulate
from simbench.progress import Progress
from simbench.scenarios.expansion import Grid
from simbench.scenarios.spec import Scenario

_RECORDS = "records.parquet"
_LOOPS = "loops.csv"
_SIGNALS = ("t", "sp", "op", "pv")
_KNOWN = ("record", "Ts", "process", "op_lo", "op_hi")
_AT_ONCE = 50  # records in a row group of the file


def write_records(
    grid: str | Path,
    out: str | Path,
    n: int | None = None,
    sets: Mapping[str, Any] | None = None,
) -> int:
    """Simulate a grid, and write its records without labels into a new folder.

    Parameters
    ----------
    grid : str or Path
        Name of a grid, a TOML file, or the folder of a run or baseline.
    out : str or Path
        Folder, which must be new or empty. It gets `records.parquet` (columns record, t in s, sp,
        op, pv; the samples of a record stand together) and `loops.csv` (record, Ts in s, process,
        and the values op_lo and op_hi of OP that mean 0 and 100 %).
    n : int, optional
        Number of scenarios that are drawn at random, the same as `run` draws.
    sets : mapping, optional
        Changed settings of the grid, such as its seed.

    Returns
    -------
    int
        Number of records. Their names are the scenario ids of a run of the same grid, and they
        stand in the order of these, which tells nothing of their labels.

    Raises
    ------
    UserError
        When the grid is wrong, the folder is not empty, or no scenario can be simulated.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     written = write_records("smoke", f"{place}/records", n=2)
    ...     written, sorted(file.name for file in Path(place, "records").iterdir())
    (2, ['loops.csv', 'records.parquet'])
    """
    # what cannot be written or simulated is refused first
    out = Path(out)
    refuse_taken(out)
    plan = read_plan(grid, {"n": n, "sets": sets})
    refuse_too_large(size_of(plan, 0, 0), plan.name)
    refuse_wrong_parts(plan)
    make_folder(out.absolute().parent)

    # a short name, as the disk may take none longer than the folder's
    half = out.absolute().with_name(f".{crc32(os.fsencode(out.name)):08x}.partial")
    shutil.rmtree(half, ignore_errors=True)  # of a call that was killed
    make_folder(half)
    try:
        written = _write_records(half, plan)
        half.replace(out)
    finally:
        shutil.rmtree(half, ignore_errors=True)
    return written


def _write_records(folder: Path, plan: Grid) -> int:
    """Write both files of the folder, and return the number of records."""
    records = _yield_records(plan)
    left_out = []
    known = []

    # Records in portions, so that a large grid needs little memory
    with (
        whole_file(folder / _RECORDS, "wb") as f,
        pq.ParquetWriter(f, _SCHEMA, compression="zstd") as writer,
    ):
        while some := list(islice(records, _AT_ONCE)):
            there = {}
            for name, r in some:
                if isinstance(r, LoopRecord):
                    there[name] = r
            for _, one in some:
                if isinstance(one, Refusal):
                    left_out.append(one.reason)
            if there:
                writer.write_table(_stack_samples(there))
            for name, r in there.items():
                known.append((name, r.Ts, r.process, *(r.op_span or ("", ""))))

    # Scenarios without a record are told once
    if left_out:
        print(
            f"{len(left_out)} scenarios could not be simulated and are left out ({left_out[0]})",
            file=sys.stderr,
        )
    if not known:
        raise ParameterError(f"no scenario of grid {plan.name} can be simulated; one is needed")

    # What is known of each loop, beside the records
    with whole_file(folder / _LOOPS) as f:
        csv.writer(f, lineterminator="\n").writerows([_KNOWN] + known)
    return len(known)


_SCHEMA = pa.schema([("record", pa.string())] + [(name, pa.float64()) for name in _SIGNALS])


def _yield_records(plan: Grid) -> Iterator[tuple[str, LoopRecord | Refusal]]:
    """Yield id and record of every scenario, or why there is none, in the order of ids."""
    scenarios = []
    for group in plan.groups():
        for one in settled(group):
            scenarios.append(one)
    scenarios.sort(key=lambda one: one[0].id)
    with Progress(total=len(scenarios), desc="simulated", delay=1.0) as bar:
        for scenario, error in scenarios:
            yield scenario.id, _record_of(scenario) if error is None else Refusal(error)
            bar.update(1)


def _record_of(scenario: Scenario) -> LoopRecord | Refusal:
    """Return the record of a scenario without MV, or why it cannot be simulated."""
    try:
        return simulate(scenario.loop, scenario.seed).record.without_mv()
    # whatever a model does on unusual numbers: this record alone
    except (Exception, SystemExit) as fault:
        return Refusal(error_text(fault))


def _stack_samples(records: Mapping[str, LoopRecord]) -> pa.Table:
    """Return the samples of records one below the other."""
    names = np.repeat(list(records), [r.n for r in records.values()])
    signals = (np.concatenate([getattr(r, name) for r in records.values()]) for name in _SIGNALS)
    return pa.Table.from_arrays([pa.array(x) for x in (names, *signals)], schema=_SCHEMA)
