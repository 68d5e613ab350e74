"""Read loops from a MATLAB file: the International Stiction Data Base (isdb10.mat), structures of
one or several loops, or the variables of one loop as `save` writes them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError, nearest, printable
from simbench.detectors.record import PROCESSES
from simbench.detectors.records.tables import Columns

# The file's words for what a loop controls, in its type or comments.
_KIND_WORDS = {
    "flow": "flow",
    "level": "level",
    "pressure": "pressure",
    "temperature": "temperature",
    "concentration": "analyser",
    "analy": "analyser",
}


def read_loops(path: Path) -> dict[str, Any]:
    """Return every loop of the file: structures under "sector.loopN", or by their own name; the
    variables of one loop by the name of the file.
    """
    from scipy.io import loadmat

    if not path.is_file():  # a pipe would be waited for
        raise RecordError(
            f"file {path} {'is no file' if path.exists() else 'does not exist'}; an ISDB file is"
            " needed"
        )
    try:
        data = loadmat(path, struct_as_record=False, squeeze_me=True)
    except Exception as error:  # loadmat raises many kinds on damaged files
        raise RecordError(
            f"file {path} cannot be read as .mat: {error}; a whole file is needed"
        ) from error
    variables = {name: value for name, value in data.items() if not name.startswith("__")}
    if any(_is_signal(value) for value in variables.values()):
        return {printable(path.stem): SimpleNamespace(_fieldnames=list(variables), **variables)}
    loops: dict[str, Any] = {}
    for name, value in variables.items():
        loops |= dict(_loops_in(value, (), name))
    if not loops:
        raise RecordError(
            f"file {path} holds no loop: variables PV and OP (and t or Ts), or structures with such"
            f" fields, are needed; it has {', '.join(variables) or 'nothing'}"
        )
    return loops


def _fields(value: Any) -> list[str]:
    return list(getattr(value, "_fieldnames", []))


def _is_signal(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.size > 1


def _loops_in(value: Any, path: tuple[str, ...], root: str) -> Iterator[tuple[str, Any]]:
    """Yield the structures that hold no further ones, by their path below the root."""
    fields = _fields(value)
    if {"time", "signals"} <= set(fields) and "values" in _fields(value.signals):
        # as Simulink logs signals without names: those of one block are the columns of a matrix
        yield (
            ".".join(path) or root,
            SimpleNamespace(_fieldnames=["t", "values"], t=value.time, values=value.signals.values),
        )
        return
    inner = [f for f in fields if _fields(getattr(value, f))]
    if fields and not inner:
        yield ".".join(path) or root, value
    for field in inner:
        yield from _loops_in(getattr(value, field), (*path, field), root)


def read_loop(path: Path, loop: str | None) -> tuple[Columns, dict[str, Any]]:
    """Return the signals of one loop and what the file states about it."""
    loops = read_loops(path)
    if loop is None:
        if len(loops) != 1:
            like = next(iter(loops), "chemicals.loop1")
            raise RecordError(
                f"file {path} holds {len(loops)} loops; name one of them, which is needed, like"
                f" {like}"
            )
        loop = next(iter(loops))
    if loop not in loops:
        raise RecordError(f"file {path}: no loop {loop!r}, {nearest(loop, loops)}")
    try:
        return _signals(loops[loop], loop)
    except (
        AttributeError,
        IndexError,
        TypeError,
        ValueError,
    ) as error:  # whatever a damaged file holds in place of numbers
        raise RecordError(
            f"file {path}: loop {loop!r} holds no signals that can be read: {error}; OP, PV are"
            " needed"
        ) from None


def _columns_of(matrix: np.ndarray, before: str) -> Columns:
    """Return the columns of a matrix, counted from 1: the longer way is that of the samples."""
    rows = matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T
    return {f"{before}{k}": np.array(column) for k, column in enumerate(rows.T, 1)}


def _signals(entry: Any, loop: str) -> tuple[Columns, dict[str, Any]]:
    fields = {str(f).lower(): getattr(entry, f) for f in entry._fieldnames}
    pv = np.atleast_1d(np.asarray(fields.get("pv", []), dtype=float))
    raw: Columns = {}
    for name in ("sp", "op", "pv"):
        values = np.atleast_1d(np.asarray(fields.get(name, []), dtype=float))
        if values.size == pv.size:
            raw[name] = values
        elif name == "sp" and values.size == 1:
            raw[name] = np.full(pv.size, values[0])
    if "ts" not in fields or not {"op", "pv"} <= set(raw):  # times, or signals of other names
        named = {str(f): getattr(entry, f) for f in entry._fieldnames}
        named = {f: np.asarray(v, dtype=float) for f, v in named.items() if _is_signal(v)}
        matrices = [f for f, v in named.items() if v.ndim > 1]
        vectors = {f: v for f, v in named.items() if v.ndim == 1}
        for f in matrices:
            vectors |= _columns_of(named[f], "" if len(matrices) == 1 else f"{f}.")
        sizes = [v.size for v in vectors.values()]
        most = pv.size if "pv" in raw and pv.size else max(sizes, key=sizes.count, default=0)
        known = {name.lower() for name in raw}
        raw |= {f: v for f, v in vectors.items() if v.size == most and f.lower() not in known}
        raw = {name: v for name, v in raw.items() if np.size(v) == most}
    comments = " ".join(
        str(c) for key in ("comments", "briefcomments") for c in np.atleast_1d(fields.get(key, ""))
    )
    type_ = fields.get("type", "")
    about: dict[str, Any] = {
        "tag": loop,
        "meta": {"comments": comments.strip(), "type": str(type_)},
    }
    words = f"{type_} {comments}".lower()
    about["kind"] = next((k for word, k in _KIND_WORDS.items() if word in words), None)
    # ISDB: 0 = self-regulating, 1 = integrating; some copies carry words instead
    about["process"] = {"0": PROCESSES[0], "1": PROCESSES[1]}.get(str(type_).removesuffix(".0"))
    if about["process"] is None and "integrating" in str(type_).lower():
        about["process"] = PROCESSES[1]
    about["Ts"] = float(np.atleast_1d(fields["ts"])[0]) if "ts" in fields else None
    return raw, about
