"""What is read is what was written: checksums of tables and of the manifest that names them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from detectors.errors import UserError

SEAL = "seal"
TABLES = "tables"


class RunError(UserError):
    """A run's folder that cannot be used as asked."""


def digest(content: bytes) -> str:
    """Return 16 hex digits that change with any bit of the content."""
    return hashlib.sha256(content).hexdigest()[:16]


def file_digest(path: Path) -> str:
    """Return 16 hex digits of a file, read in blocks."""
    with open(path, "rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()[:16]


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return JSON content with a checksum over all of it as its last key.

    Examples
    --------
    >>> content = sealed({"grid": "ci"})
    >>> opened(content, "manifest.json"), len(content["seal"])
    ({'grid': 'ci'}, 16)
    """
    plain = {k: v for k, v in content.items() if k != SEAL}
    return {**plain, SEAL: _of(plain)}


def opened(content: Mapping[str, Any], where: object) -> dict[str, Any]:
    """Return sealed content without its checksum; raise RunError when it is not what was sealed."""
    plain = {k: v for k, v in content.items() if k != SEAL}
    if content.get(SEAL) != _of(plain):
        why = "carries no checksum: it was written by an older simbench" if SEAL not in content else "was changed after the run"
        raise RunError(f"{where} {why}; run it again, or restore it")
    return plain


def check_tables(folder: str | Path, manifest: Mapping[str, Any]) -> None:
    """Raise RunError when a table of a run or baseline is not the one its manifest speaks of.

    Parameters
    ----------
    folder : str or Path
        Of the run or baseline.
    manifest : mapping
        As `simbench.bench.manifest.read_manifest` gives it.
    """
    if not manifest.get("complete"):
        raise RunError(f"{folder} is not finished; continue the run with --resume")
    for kind in ("scenarios", "verdicts"):
        file = Path(folder) / f"{kind}.parquet"
        if not file.is_file():
            raise RunError(f"{folder} is damaged: {file.name} is missing; restore it, or run it again")
        if file_digest(file) != manifest.get(TABLES, {}).get(kind):
            raise RunError(f"{file} is not the table its manifest speaks of; restore it, or run it again")


def _of(plain: Mapping[str, Any]) -> str:
    # through JSON once: tuples become lists, keys become text, as they will be read
    return digest(json.dumps(json.loads(json.dumps(plain)), sort_keys=True).encode())
