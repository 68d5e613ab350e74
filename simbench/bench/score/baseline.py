"""A baseline: a run's folder without what no comparison needs, small enough to commit."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from simbench.bench.score.names import OF_NOT_OSCILLATING
from simbench.bench.score.scoring import score_run
from simbench.bench.score.tally import RATES
from simbench.bench.store.checksums import digest
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.bench.store.reading import read_table
from simbench.files import folder as make_folder
from simbench.files import whole_file, write_table

_EMPTY = {
    "scenarios": ("flags",),
    "verdicts": ("reason", "indices", "S_unit", "runtime_s"),
}
_KEPT = (
    "format",
    "grid",
    "grid_hash",
    "grid_content",
    "seed",
    "overrides",
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
    "method",
    "truth",
    "process",
    "population",
    "n",
    "positives",
    "applicable",
    *RATES,
    "auc",
    "sensitivity_at_5",
    "cost",
    "risk_coverage",
    "rank",
    "errors",
)


def write_baseline(run: str | Path, baseline: str | Path) -> None:
    """Write a run as a baseline; its manifest comes last.

    The tables keep their columns, those that no check needs are empty; scores, S and J keep 24
    bits. The loops stay: every flip can be simulated again. scores.csv is there for the eye: its
    difference in version control reads as accuracy gained and lost.
    """
    baseline = make_folder(baseline)
    whole = read_manifest(run)
    manifest = {k: v for k, v in whole.items() if k in _KEPT}
    digests = {}
    for kind, empty in _EMPTY.items():
        table = read_table(run, kind)
        for name in empty:
            column = table.schema.get_field_index(name)
            table = table.set_column(
                column,
                table.schema.field(name),
                pa.nulls(table.num_rows, table.schema.field(name).type),
            )
        if kind == "verdicts":
            for name in ("score", "S_lo", "S_hi", "J_lo", "J_hi"):
                at = table.schema.get_field_index(name)
                rounded = (
                    table.column(name)
                    .to_numpy(zero_copy_only=False)
                    .astype(np.float32)
                    .astype(float)
                )
                table = table.set_column(
                    at, table.schema.field(at), pa.array(rounded, from_pandas=True)
                )
        out = io.BytesIO()
        # whole scenarios in every row group
        pq.write_table(
            table, out, compression="zstd", row_group_size=500 * max(len(manifest["methods"]), 1)
        )
        digests[kind] = digest(out.getvalue())
        with whole_file(baseline / f"{kind}.parquet", "wb") as f:
            f.write(out.getvalue())
    write_manifest(baseline, {**manifest, "tables": digests})
    table = score_run(baseline).table
    shown = table["population"] != OF_NOT_OSCILLATING
    write_table(
        table.loc[shown, list(_BASELINE_COLUMNS)], baseline / "scores.csv", float_format="%.4f"
    )
