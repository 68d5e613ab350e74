"""Write the positions of a valve into a table: what the verb `valve` does."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.clock import seconds
from simbench.detectors.records.dialects import words
from simbench.detectors.records.gaps import JITTER
from simbench.detectors.records.historian import read_numbers
from simbench.detectors.records.tables import read_sheet
from simbench.files import plain_cell, refuse_kind, whole_file
from simbench.loop.response import valve_response


def valve_file(
    source: str | Path,
    out: str | Path,
    model: str,
    parameters: Mapping[str, Any] | None = None,
) -> None:
    """Send the column `op` of a table through one valve model."""
    refuse_kind(out)
    sheet = read_sheet(Path(source))
    table = sheet.columns
    names = {name.lower(): name for name in table}
    if "op" not in names:
        raise RecordError(f"{source}: no column op; columns are: {', '.join(table)}")
    op = read_numbers(sheet, [names["op"]], str(source))[names["op"]]
    empty = np.flatnonzero(np.isnan(op))
    if empty.size:
        raise RecordError(
            f"{source}, line {empty[0] + 2}: {names['op']} is empty; a valve needs OP at every"
            " sample"
        )
    Ts = 1.0
    time = next((names[name] for name in words("time") if name in names), None)
    if time is not None and op.size > 1:
        step = np.diff(seconds(table[time], time, str(source)))
        Ts = float(np.median(step))
        uneven = np.flatnonzero(np.abs(step - Ts) > JITTER * Ts)
        if uneven.size:
            at = uneven[0] + 3
            dt = step[uneven[0]]
            raise RecordError(
                f"{source}, line {at}: a time step of {dt:g} s among steps of {Ts:g} s; even steps"
                " are needed"
            )
    columns = {name: cells for name, cells in table.items() if name.lower() != "mv"}
    columns["mv"] = valve_response(model, op, parameters or {}, Ts).tolist()
    with whole_file(out) as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(map(plain_cell, columns))
        writer.writerows(map(plain_cell, row) for row in zip(*columns.values()))
