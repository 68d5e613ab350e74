"""Write the answers of a blind test to the key alone; the commitment (checksum of the key) in the
folder proves later that they were not changed.
"""

from __future__ import annotations

import json
import secrets
from pathlib import Path

from results.studies.withheld.outcomes import write_whole
from simbench.detectors.errors import ParameterError
from simbench.sealed.handout import commitment_of, matches, read_key, write_key

COMMITMENT = "commitment.txt"


def key_to(answers: str) -> bytes:
    """Return the content of a key that holds the text of answers.csv; its salt keeps the commitment
    from telling equal answers.
    """
    return json.dumps({"salt": secrets.token_hex(32), "answers": answers}).encode()


def write(content: bytes, folder: Path, key: Path) -> None:
    """Write the commitment into the folder, and the key elsewhere, readable by its owner only."""
    write_whole(folder / COMMITMENT, f"{commitment_of(content)}\n")
    write_key(key, content)


def is_key_of(key: Path, folder: Path) -> bool:
    """Return whether a file is the key to the answers of a folder."""
    try:
        return matches(key.read_bytes(), _published(folder))
    except (OSError, ValueError):
        return False


def read(folder: Path, key: Path) -> tuple[str, str]:
    """Return the text of answers.csv from a key, and the commitment in the folder."""
    try:
        published = _published(folder)
    except OSError as error:
        raise ParameterError(
            f"withheld: {error.filename} cannot be read: {error.strerror}"
        ) from None
    answers = read_key("withheld", key, folder, published).get("answers")
    if not isinstance(answers, str):
        raise ParameterError(f"withheld: {key} is no key file")
    return answers, published


def _published(folder: Path) -> str:
    return (folder / COMMITMENT).read_text(encoding="utf-8").strip()
