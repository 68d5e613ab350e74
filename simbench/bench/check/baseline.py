"""A baseline: a run's folder without what no comparison needs, small enough to commit."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from simbench.bench.score.answers import RATES
from simbench.bench.score.names import OF_NOT_OSCILLATING
from simbench.bench.score.scoring import score_run
from simbench.bench.store.benchmark import LOOP_KEYS
from simbench.bench.store.folder import PIECES, RunError, digest, visible_names, write_file
from simbench.bench.store.manifest import MANIFEST, read_manifest, write_manifest
from simbench.bench.store.reading import read_table
from simbench.files import folder as make_folder
from simbench.files import write_table

# columns that no check needs; and those that stand in the table of the grid, or in the run that
# shipped verdicts are joined to
_EMPTY = {
    "scenarios": ("flags",),
    "verdicts": ("reason", "indices", "S_unit", "runtime_s"),
}
_EMPTY_SHIPPED = {**_EMPTY, "scenarios": ("flags", "loop", "no_waveform")}
_ROUNDED = ("score", "S_lo", "S_hi", "J_lo", "J_hi")  # to 24 bits
_KEPT = (
    "format",
    "grid",
    "grid_hash",
    "grid_content",
    "seed",
    "overrides",
    LOOP_KEYS,
    "scenarios",
    "methods",
    "plugins",
    "command",
    "code",
    "commit",
    "versions",
    "machine",
    "processor",
    "complete",
    "counts",
    "records_hash",
    "benchmark",
)
_BASELINE_COLUMNS = (
    ("method", "truth", "process", "population", "n", "positives", "applicable")
    + RATES
    + ("auc", "sensitivity_at_5", "cost", "rank", "errors")
)


def write_baseline(run: str | Path, baseline: str | Path) -> None:
    """Write a run as a baseline; its manifest comes last.

    The tables keep their columns, those that no check needs are empty; scores, S and J keep 24
    bits. The loops stay: every flip can be simulated again. scores.csv is there for the eye: its
    difference in version control reads as accuracy gained and lost.
    """
    baseline = _write_verdicts(run, baseline, _EMPTY)
    table = score_run(baseline).table
    shown = table["population"] != OF_NOT_OSCILLATING
    write_table(
        table.loc[shown, list(_BASELINE_COLUMNS)], baseline / "scores.csv", float_format="%.4f"
    )


def write_shipped(run: str | Path, folder: str | Path) -> None:
    """Write a run's verdicts as the package ships them: as a baseline, without its loops, which the
    table of the grid holds, and without scores.
    """
    _write_verdicts(run, folder, _EMPTY_SHIPPED)


def _write_verdicts(
    run: str | Path, folder: str | Path, emptied: Mapping[str, Sequence[str]]
) -> Path:
    """Write the tables of a run with some columns empty, and the manifest, which comes last."""
    # where it is written, and what a baseline says of its run
    _refuse_foreign(Path(folder))
    folder = make_folder(folder)
    whole = read_manifest(run)
    manifest = {}
    for k, v in whole.items():
        if k in _KEPT:
            manifest[k] = v

    # the tables, without what no comparison needs
    digests = {}
    for kind, names in emptied.items():
        table = read_table(run, kind)
        for name in names:
            place = table.schema.get_field_index(name)
            field = table.schema.field(place)
            table = table.set_column(place, field, pa.nulls(table.num_rows, field.type))
        if kind == "verdicts":
            for name in _ROUNDED:
                place = table.schema.get_field_index(name)
                values = table.column(name).to_numpy(zero_copy_only=False)
                short = pa.array(values.astype(np.float32).astype(float), from_pandas=True)
                table = table.set_column(place, table.schema.field(place), short)
        out = io.BytesIO()
        # whole scenarios in every row group
        pq.write_table(
            table,
            out,
            compression="zstd",
            write_page_checksum=True,
            row_group_size=500 * max(len(manifest["methods"]), 1),
        )
        write_file(folder / f"{kind}.parquet", out.getvalue())
        digests[kind] = digest(out.getvalue())

    # The manifest with the digests of both tables
    write_manifest(folder, {**manifest, PIECES: [{"digests": digests}]})
    return folder


def _refuse_foreign(folder: Path) -> None:
    """Raise RunError where a folder holds files, and no manifest of a run or baseline, be it an
    older one.
    """
    if not visible_names(folder):
        return
    with contextlib.suppress(OSError, ValueError, RecursionError):
        stated = json.loads((folder / MANIFEST).read_bytes())
        if isinstance(stated, dict) and stated.keys() >= {"format", "grid_hash", "methods"}:
            return
    raise RunError(
        f"{folder} is not empty and holds no baseline, so nothing was written there; name an empty"
        " or a new folder, or one of a baseline"
    )
