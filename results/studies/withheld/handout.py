"""Hand out records without their truth: write the key elsewhere, and bind it by a commitment
(checksum).

Whoever answers holds no key; whoever opens shows by the commitment that the key was fixed before
anybody answered.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from pathlib import Path
from typing import Any

from simbench.detectors.errors import ParameterError, UserError
from simbench.files import folder, plain_bytes, refuse_own_input, whole_file


def commitment_of(content: bytes) -> str:
    """Return what is published about secret content: its SHA-256 as 64 hex digits."""
    return hashlib.sha256(content).hexdigest()


def matches(content: bytes, commitment: str) -> bool:
    """Return whether secret content is the one that was committed to.

    >>> matches(b"seed 4", commitment_of(b"seed 4")), matches(b"seed 5", commitment_of(b"seed 4"))
    (True, False)
    """
    return hmac.compare_digest(commitment_of(content).encode(), commitment.encode())


def refuse_key_inside(what: str, key: Path, place: Path) -> None:
    """Raise ParameterError when a key would be handed out with the folder that it opens; `what`
    begins the sentence.
    """
    if place.resolve() in (key.resolve(), *key.resolve().parents):
        raise ParameterError(
            f"{what}: the key {key} would lie inside {place}; another folder is needed"
        )


def refuse_unwritable_key(key: Path) -> None:
    """Raise FileError, before minutes of work, when a key cannot be written."""
    folder(key.parent)
    refuse_own_input([key], [])


def write_key(key: Path, content: bytes) -> None:
    """Write a key whole, readable by its owner only."""
    with whole_file(key, "wb") as f:
        Path(f.name).chmod(0o600)
        f.write(content)


def read_key(what: str, key: Path, place: Path, commitment: str) -> dict[str, Any]:
    """Return the JSON table that a key holds; ParameterError for any other file, and for the key of
    another folder than the `place` that holds the commitment.
    """
    try:
        content = plain_bytes(key)
        table = json.loads(content)
    except UserError as error:
        raise ParameterError(f"{what}: {error}") from None
    except OSError as error:
        raise ParameterError(f"{what}: {error.filename} cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise ParameterError(f"{what}: {key} is no key file")
    if not matches(content, commitment):
        raise ParameterError(
            f"{what}: the SHA-256 of {key} is not the commitment in {place}; another key was made"
            " for it"
        )
    return table
