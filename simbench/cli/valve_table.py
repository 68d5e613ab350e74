"""Write the positions of a valve into a table: what the verb `valve` does."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.columns import parse, read_numbers
from simbench.detectors.records.files import read_texts
from simbench.detectors.records.times import JITTER, read_times
from simbench.files import plain_cell, refuse_kind, whole_file
from simbench.loop.response import valve_response


def valve_file(
    source: str | Path,
    out: str | Path,
    model: str,
    parameters: Mapping[str, Any] | None = None,
) -> None:
    """Send the column `op` of a table through one valve model."""
    # the column of OP, known at every sample
    refuse_kind(out)
    table = read_texts(source)
    names = {}
    for name in table.columns:
        names[name.lower()] = name
    if "op" not in names:
        raise RecordError(f"{source}: no column op; columns are: {', '.join(table.columns)}")
    op = read_numbers(table, [names["op"]])[names["op"]]
    empty = np.flatnonzero(np.isnan(op))
    if empty.size:
        where = f"{source}, {table.place(empty[0])}: {names['op']} is empty"
        raise RecordError(f"{where}; a valve needs OP at every sample")

    # its sampling period, a second where no time is given
    Ts = 1.0
    time = next((name for name in table.columns if parse(name).role == "t"), None)
    if time is not None and op.size > 1:
        steps = np.diff(read_times(table, time))
        Ts = float(np.median(steps))
        uneven = np.flatnonzero(np.abs(steps - Ts) > JITTER * Ts)
        if uneven.size:
            where = f"{source}, {table.place(uneven[0] + 1)}: a time step of {steps[uneven[0]]:g} s"
            raise RecordError(f"{where} among steps of {Ts:g} s; even steps are needed")

    # the table with the position in place of one that it had
    columns = {name: cells for name, cells in table.columns.items() if name.lower() != "mv"}
    columns["mv"] = valve_response(model, op, parameters or {}, Ts).tolist()
    with whole_file(out) as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(map(plain_cell, columns))
        writer.writerows(map(plain_cell, row) for row in zip(*columns.values()))
