"""Read the International Stiction Data Base (isdb10.mat), loop by loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError, nearest
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
    """Return every loop structure of the file under "sector.loopN"."""
    from scipy.io import loadmat

    if not path.is_file():  # a pipe would be waited for
        raise RecordError(
            f"file {path} {'is no file' if path.exists() else 'does not exist'}; an ISDB file is"
            " needed"
        )
    try:
        data = loadmat(path, struct_as_record=False, squeeze_me=True)["cdata"]
    except KeyError:
        raise RecordError(
            f"file {path}: no structure cdata; an ISDB file (cdata.sector.loopN) is needed"
        ) from None
    except Exception as error:  # loadmat raises many kinds on damaged files
        raise RecordError(
            f"file {path} cannot be read as .mat: {error}; a whole file is needed"
        ) from error
    loops = {}
    for sector in getattr(data, "_fieldnames", []):
        group = getattr(data, sector)
        for name in getattr(group, "_fieldnames", []):
            loops[f"{sector}.{name}"] = getattr(group, name)
    return loops


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
