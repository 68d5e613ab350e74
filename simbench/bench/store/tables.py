"""The two tables of a run: their columns, and how a piece of them becomes a parquet file."""

from __future__ import annotations

import io
import math
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

FORMAT = 1
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
)
_WORDS = ("block", "member", "process", "controller", "valve", "disturbance", "tuning")
_COUNTS = ("cell", "repeat")
TAG_KEYS = (*_COUNTS, "block", "member", "process", "controller", "valve", *AXES)

SCENARIOS = pa.schema(
    [
        ("scenario_id", _TEXT),
        ("group", pa.int64()),
        *(
            (name, pa.int64() if name in _COUNTS else _TEXT if name in _WORDS else _NUMBER)
            for name in TAG_KEYS
        ),
        ("seed", pa.int64()),
        ("sticky", pa.bool_()),
        ("S", _NUMBER),  # mapped, % of travel
        ("J", _NUMBER),
        ("predicted", pa.bool_()),
        ("refined", pa.bool_()),
        ("theory", pa.bool_()),
        ("theory_period", _NUMBER),
        ("theory_amplitude", _NUMBER),
        ("theory_reason", _TEXT),  # why theory has nothing to say of this loop
        ("cycled", _TEXT),
        ("cycle_period", _NUMBER),
        ("cycle_swing", _NUMBER),
        ("Ts", _NUMBER),
        ("n", pa.int64()),
        ("noise_std", _NUMBER),
        ("oscillating", pa.bool_()),
        ("regularity", _NUMBER),
        ("period_s", _NUMBER),
        ("flags", _TEXT),
        ("no_waveform", pa.list_(pa.float32())),  # as `simbench.bench.score.no_waveform` names them
        ("record_hash", _TEXT),
        ("loop", _TEXT),
        ("tags", _TEXT),
        ("error", _TEXT),
    ]
)
VERDICT_SCHEMA = pa.schema(
    [
        ("scenario_id", _TEXT),
        ("method", _TEXT),
        ("verdict", _TEXT),
        ("score", _NUMBER),
        ("verdict_raw", _TEXT),
        ("score_raw", _NUMBER),
        ("applicable", pa.bool_()),
        ("reason", _TEXT),
        ("reason_raw", _TEXT),
        ("indices", _TEXT),
        ("S_lo", _NUMBER),
        ("S_hi", _NUMBER),
        ("J_lo", _NUMBER),
        ("J_hi", _NUMBER),
        ("S_unit", _TEXT),
        ("error", _TEXT),
        ("runtime_s", _NUMBER),
    ]
)


def encode(columns: dict[str, list[Any]], schema: pa.Schema, number: int) -> bytes:
    """Return columns as the bytes of a parquet file (zstd) that knows its number."""
    arrays = [pa.array(_nulls(columns[f.name]), type=f.type) for f in schema]
    return as_parquet(pa.Table.from_arrays(arrays, schema=schema), number)


def as_parquet(table: pa.Table, number: int) -> bytes:
    """Return a table as `encode` does columns."""
    out = io.BytesIO()
    pq.write_table(
        table.replace_schema_metadata({"format": str(FORMAT), "piece": str(number)}),
        out,
        compression="zstd",
    )
    return out.getvalue()


def _nulls(values: list[Any]) -> list[Any]:
    return [None if isinstance(v, float) and math.isnan(v) else v for v in values]
