"""Define the two tables of a run (verdicts and scenarios): their columns, and how a piece of them
becomes a parquet file.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

FORMAT = 3
_TEXT = pa.string()
_NUMBER = pa.float64()
AXES = (
    "Td_over_T",
    "Td_over_Ti",
    "S_over_2J",
    "noise_ratio",
    "disturbance",
    "tuning",
    "samples_per_period",
    "echo",
    "cut",
)
WORD_COLUMNS = (
    "block",
    "member",
    "process",
    "controller",
    "valve",
    "disturbance",
    "tuning",
    "echo",
)
_COUNTS = ("cell", "repeat")
RANKED = "ranked"  # 0: no ranking counts this loop
CELL_S_OVER_2J = "cell_S_over_2J"  # also of a healthy loop, whose own S_over_2J is 0
TAG_KEYS = (
    _COUNTS
    + ("block", "member", "process", "controller", "valve")
    + AXES
    + (CELL_S_OVER_2J, RANKED)
)

_TYPES = {
    "text": _TEXT,
    "number": _NUMBER,
    "count": pa.int64(),
    "flag": pa.bool_(),
    "numbers": pa.list_(pa.float32()),
}


def _typed_columns(table: str) -> list[tuple[str, pa.DataType]]:
    """Return the columns of lines that begin with a type, in their order."""
    lines = [line.split() for line in table.strip().splitlines()]
    columns = []
    for kind, *names in lines:
        for name in names:
            columns.append((name, _TYPES[kind]))
    return columns


# S and J: mapped, % of travel; theory_reason: why theory has nothing to say of this loop;
# no_waveform: as `simbench.bench.score.no_waveform` and `rhythm` name them
SCENARIOS = pa.schema(
    [("scenario_id", _TEXT), ("loop_digest", _TEXT), ("group", pa.int64())]
    + [
        (name, pa.int64() if name in _COUNTS else _TEXT if name in WORD_COLUMNS else _NUMBER)
        for name in TAG_KEYS
    ]
    + _typed_columns("""
            count seed
            flag sticky
            number S J
            flag predicted refined theory
            number theory_period theory_amplitude
            text theory_reason cycled
            number cycle_period cycle_swing Ts
            count n
            number noise_std
            flag oscillating
            number regularity period_s
            text flags
            numbers no_waveform
            text record_hash loop tags error
        """)
)
VERDICT_SCHEMA = pa.schema(
    _typed_columns("""
        text scenario_id method verdict
        number score
        flag applicable
        text reason indices
        number S_lo S_hi J_lo J_hi
        text S_unit error
        number runtime_s
    """)
)


def encode(rows: Sequence[Mapping[str, Any]], schema: pa.Schema, number: int) -> bytes:
    """Return rows as the bytes of a parquet file (zstd) that knows its number."""
    return as_parquet(as_table(rows, schema), number)


def as_table(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> pa.Table:
    """Return rows as a table; null where a row has no value, or NaN."""
    arrays = [
        pa.array(_replace_nan([row.get(f.name) for row in rows]), type=f.type) for f in schema
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def as_parquet(table: pa.Table, number: int) -> bytes:
    """Return a table as `encode` does columns."""
    out = io.BytesIO()
    pq.write_table(
        table.replace_schema_metadata({"format": str(FORMAT), "piece": str(number)}),
        out,
        compression="zstd",
        write_page_checksum=True,
    )
    return out.getvalue()


def _replace_nan(values: list[Any]) -> list[Any]:
    return [None if isinstance(v, float) and math.isnan(v) else v for v in values]
