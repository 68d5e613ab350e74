"""Read loops from a MATLAB file: the International Stiction Data Base (isdb10.mat), structures of
one or several loops, or the vectors of one loop as `save` writes them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import PROCESSES
from simbench.detectors.records.files import Sheet

# the file's words for what a loop controls, in its type or comments
_KINDS = ("flow", "level", "pressure", "temperature", "concentration", "analyser", "analyzer")
# the data base's numbers, or words, for the process
_PROCESSES = {"0": PROCESSES[0], "1": PROCESSES[1], "integrating": PROCESSES[1]}


def read_loops(path: Path) -> dict[str, Sheet]:
    """Return every loop of a file: structures by "sector.loopN", or their own name, and vectors
    under "".
    """
    from scipy.io import loadmat

    # what MATLAB wrote
    if not path.is_file():  # a pipe would be waited for
        why = "is no file" if path.exists() else "does not exist"
        raise RecordError(f"file {path} {why}; a .mat file is needed")
    try:
        data = loadmat(path, simplify_cells=True)
    except Exception as error:  # loadmat raises many kinds on damaged files
        broken = f"file {path} cannot be read as .mat: {error}"
        raise RecordError(f"{broken}; a whole file is needed") from error
    variables = {}
    for name, value in data.items():
        if not name.startswith("__"):
            variables[name] = value

    # vectors of one loop, or structures that hold no further ones
    if any(map(_is_vector, variables.values())):
        return {"": _table_of(str(path), variables)}
    roots = {}
    for name, value in variables.items():
        if isinstance(value, dict):
            roots[name] = value
    found = []
    for name, root in roots.items():
        for way, f in _find_loops(root):
            found.append((way or name, f))
    if not found:
        has = ", ".join(variables) or "nothing"
        needed = "variables PV and OP (and t or Ts), or structures with such fields, are needed"
        raise RecordError(f"file {path} holds no loop: {needed}; it has {has}")
    return {name: _table_of(str(path), fields) for name, fields in found}


def _find_loops(fields: dict[str, Any], way: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the structures below one that hold no further ones, by their names with points."""
    inner = {}
    for name, value in fields.items():
        if isinstance(value, dict):
            inner[name] = value
    if not inner:
        yield way, fields
    for name, value in inner.items():
        yield from _find_loops(value, f"{way}.{name}".lstrip("."))


def _is_vector(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.ndim == 1


def _table_of(where: str, fields: dict[str, Any]) -> Sheet:
    """Return the signals of one loop, and what the file states about it."""
    # its vectors, as long as PV or as most of them; a set point may be one number
    for name, value in fields.items():
        if np.iscomplexobj(value):
            raise RecordError(f"{where}: {name} holds complex numbers; real ones are needed")
    low = {}
    for name, value in fields.items():
        low[name.lower()] = value
    vectors = {}
    for name, value in fields.items():
        if _is_vector(value):
            vectors[name] = value

    # Signals are vectors as long as PV, or as most are
    sizes = Counter(value.size for value in vectors.values()).most_common(1)
    if _is_vector(low.get("pv")):
        most = np.size(low["pv"])
    elif sizes:
        most = sizes[0][0]
    else:
        most = 0
    columns = {}
    for name, x in vectors.items():
        if x.size == most:
            columns[name] = x.astype(np.float64)
    if isinstance(low.get("sp"), (int, float)):
        columns["sp"] = np.full(most, float(low["sp"]))

    # what it controls, the process, the sampling period
    kind = str(low.get("type", ""))
    said = [np.atleast_1d(low.get(key, "")) for key in ("comments", "briefcomments")]
    comments = " ".join(str(c) for text in said for c in text).strip()
    words = f"{kind} {comments}".lower()
    about = {
        "meta": {"comments": comments, "type": kind},
        "kind": next((k for k in _KINDS if k in words), None),
        "process": _PROCESSES.get(kind.lower().removesuffix(".0")),
        "Ts": float(low["ts"]) if isinstance(low.get("ts"), (int, float)) else None,
    }

    # The table with what it says about itself
    return Sheet(where, columns, about=about)
