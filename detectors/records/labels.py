"""Tables of labels: what is known of the records of a folder."""

from __future__ import annotations

import re
from pathlib import Path

from simbench.detectors.errors import RecordError, nearest
from simbench.detectors.record import KIND_ALIASES, KINDS, PROCESSES, hyphenated
from simbench.detectors.records.dialects import entries
from simbench.detectors.records.tables import read_table

_RECORD_LABELS = ("stiction", "no_stiction", "unknown")
# what a loop without stiction may have instead; more words may follow ("tuning problem")
_CAUSES = entries("""
    tuning, disturbance, load, interaction, sensor, nonlinearity, quantisation, healthy, other
""")


def read_labels(path: str | Path) -> dict[str, dict[str, str]]:
    """Read a table of labels, one row per record."""
    raw = read_table(Path(path))
    rows = {str(k).strip().lower(): v for k, v in raw.items()}
    key = next((k for k in ("id", "record") if k in rows), None)
    if key is None or "label" not in rows:
        has = ", ".join(rows)
        raise RecordError(
            f"{path}: a table of labels needs the columns id (or record) and label; it has"
            f" {has:.200}"
        )
    table = {}
    for i, name in enumerate(rows[key]):
        row = {k: str(v[i]).strip() for k, v in rows.items()}
        kind = hyphenated(row.get("kind") or row.get("type", ""))
        process = hyphenated(row.get("process") or row.get("dynamics", ""))
        row["kind"] = kind if KIND_ALIASES.get(kind, kind) in KINDS else ""
        row["process"] = process if process in PROCESSES else ""
        row["loop"] = row.get("loop") or str(name)
        row["unit_group"] = row.get("unit_group") or row["loop"]
        row["label"] = _label(row["label"], f"{path}, line {i + 2}")
        table[str(name).strip()] = row
    return table


def _label(text: str, where: str) -> str:
    # a misspelt "stiction" would count as its opposite
    word = "_".join(re.findall(r"[a-z]+", text.lower()))
    if text in ("", "nan"):
        return ""
    if word not in _RECORD_LABELS and not word.startswith(_CAUSES):
        raise RecordError(
            f"{where}: label {text[:60]!r} is unknown, {nearest(word, (*_RECORD_LABELS, *_CAUSES))}"
        )
    return word
