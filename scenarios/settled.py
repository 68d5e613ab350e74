"""A grid whose scenarios were settled before, so that none need be simulated to be set up: the
frozen table of a grid of the package, or the loops that a run or a baseline stored.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from hashlib import sha256
from importlib.resources import files
from typing import Any

import numpy as np

from simbench.scenarios.cell import Draft, Rules
from simbench.scenarios.errors import SpecError
from simbench.scenarios.expansion import Grid, Group
from simbench.scenarios.grid import packaged_grid
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import content_hash

COLUMNS = ("group", "scenario_id", "seed", "loop", "tags")  # of the table, a row per scenario


@dataclass(frozen=True)
class SettledGrid(Grid):
    """A grid and the table of its scenarios, which stand as they are: loops, seeds and ids."""

    table: bytes = b""  # a parquet file with `COLUMNS`
    planned: int = 0  # scenarios of the grid, with echoes that were left out

    def __getstate__(self) -> dict[str, Any]:
        # what can be read again does not travel to workers
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __len__(self) -> int:
        """Number of scenarios planned."""
        return self.planned

    @property
    def hash(self) -> str:
        """16 hex digits that change with the grid and with the table."""
        return content_hash({"grid": super().hash, "table": sha256(self.table).hexdigest()})

    @cached_property
    def _rows_of_file(self) -> dict[int, list[dict[str, Any]]]:
        import pyarrow.parquet as pq

        found: dict[int, list[dict[str, Any]]] = {}
        for row in pq.ParquetFile(io.BytesIO(self.table)).read(list(COLUMNS)).to_pylist():
            found.setdefault(row["group"], []).append(row)
        return found

    @property
    def group_count(self) -> int:
        """Number of groups, up to the last that has a scenario."""
        return max(self._rows_of_file, default=-1) + 1

    def size(self, index: int) -> int:
        """Return the number of scenarios of a group."""
        return len(self._rows_of_file.get(index, ()))

    def samples(self, most: int = 200) -> list[int]:
        """Return one group: they were all tried when they were settled."""
        return list(self._rows_of_file)[:1]

    def some(self, points: int) -> SettledGrid:
        """Return the grid of `points` of these scenarios, each as likely as any other; SpecError
        where there are fewer.
        """
        rows = []
        for index in sorted(self._rows_of_file):
            for row in self._rows_of_file[index]:
                rows.append(row)
        if not 1 <= points <= len(rows):
            raise SpecError(
                f"{self.name}: {points} points; 1 to {len(rows)} are allowed, as it has so many"
                " scenarios"
            )
        rng = np.random.default_rng([self.content.seed, points])
        chosen = np.sort(rng.choice(len(rows), points, replace=False))
        return replace(self, table=table_of(rows[i] for i in chosen), planned=points)

    def group(self, index: int) -> Group:
        """Return a group with nothing left to settle."""
        # The rows of the group, as drafts with nothing to settle
        drafts = []
        for row in self._rows_of_file.get(index, ()):
            drafts.append(
                Draft(
                    Loop.from_table(json.loads(row["loop"])),
                    json.loads(row["tags"]),
                    Rules(),
                    row["seed"],
                    row["scenario_id"],
                )
            )

        # A group without rows still has a loop of the grid's kind
        first = next(iter(self._rows_of_file.values()))[0]
        if drafts:
            twin = drafts[0].loop
        else:
            twin = Loop.from_table(json.loads(first["loop"]))
        return Group(index, twin, Rules(), tuple(drafts))


def table_of(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """Return rows with `COLUMNS` as the table of a settled grid."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {"group": pa.int64(), "seed": pa.int64()}
    schema = pa.schema([(name, kinds.get(name, pa.string())) for name in COLUMNS])
    kept = [{name: row[name] for name in COLUMNS} for row in rows]
    out = io.BytesIO()

    # the smallest that any setting gives: it is in the package
    pq.write_table(
        pa.Table.from_pylist(kept, schema=schema),
        out,
        compression="zstd",
        compression_level=19,
        use_dictionary=["tags"],
    )
    return out.getvalue()


def settled_grid(name: str) -> SettledGrid:
    """Return a grid of the package with its frozen table."""
    grid = packaged_grid(name)
    return SettledGrid(name, grid.content, {}, table_file(name).read_bytes(), len(grid))


def table_file(name: str) -> Any:
    """Return the file that holds the table of a grid of the package."""
    return files("simbench.scenarios") / "grids" / f"{name}.parquet"
