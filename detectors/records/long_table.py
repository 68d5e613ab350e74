"""Long tables, as historians export several tags: one row per time, tag and value."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from detectors.records.clock import seconds
from detectors.records.historian import apply_quality, long_columns, means, read_numbers
from detectors.records.roles import QUALITY, SIGNALS, ends_with, find_roles
from detectors.records.tables import Sheet


def unfold(sheet: Sheet, loop: str | None, chosen: Mapping[str, str], where: str) -> dict[str, Sheet] | None:
    """Take a long table (time, tag, value) apart."""
    names = list(sheet.columns)
    found = long_columns(names)
    if found is None or {"pv", "op"} <= {r for r in SIGNALS for n in names if means(n, r)}:
        return None
    time, tag, value = found
    tags = [str(v).strip() for v in sheet.columns[tag]]
    roles = find_roles(list(dict.fromkeys(tags)), {k: v for k, v in chosen.items() if k != "t"}, where, loop)
    parts = {}
    others = [n for n in names if ends_with(n, QUALITY) is not None]
    for role in (r for r in SIGNALS if r in roles):
        rows = [i for i, t in enumerate(tags) if t == roles[role]]
        lines = [sheet.lines[i] for i in rows] if sheet.lines else []
        columns = {new: [sheet.columns[old][i] for i in rows] for new, old in (("t", time), (roles[role], value))}
        if others:
            columns["quality"] = [sheet.columns[others[0]][i] for i in rows]
        parts[role] = Sheet(columns, lines, sheet.delimiter)
    return parts


def read_series(part: Sheet, role: str, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (s) and values of one tag of a long table, what is missing left out."""
    name = next(n for n in part.columns if n not in ("t", "quality"))
    signal = {role: read_numbers(part, [name], where)[name]}
    apply_quality(part, {role: name}, signal, where)
    t = seconds(part.columns["t"], f"time of {name}", where, place=part.place, notes=part.notes)
    known = np.isfinite(signal[role])
    return t[known], signal[role][known]
