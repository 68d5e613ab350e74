"""Write the answers of a blind test to the key alone; the commitment (checksum of the key) in the
folder proves later that they were not changed.
"""

from __future__ import annotations

import io
import json
import secrets
from pathlib import Path
from typing import Any

import pandas as pd

from results.studies.withheld.files import write_whole
from results.studies.withheld.handout import commitment_of, matches, read_key, write_key
from simbench.detectors.errors import ParameterError

COMMITMENT, OPEN_ANSWERS = "commitment.txt", "answers.csv"


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


def read_any(folder: Path, key: Path | None) -> tuple[str, str | None]:
    """Return the text of answers.csv, from the key where there is a commitment and else from a
    plain file in the folder, and the commitment.
    """
    if (folder / COMMITMENT).exists():
        if key is None:
            raise ParameterError(
                f"withheld: the answers to {folder} are in its key alone; a key is needed"
            )
        return read(folder, key)
    try:
        return (folder / OPEN_ANSWERS).read_text(encoding="utf-8"), None
    except OSError as error:
        raise ParameterError(
            f"withheld: {folder} has neither {COMMITMENT} nor a readable {OPEN_ANSWERS}:"
            f" {error.strerror}"
        ) from None


def rows_of(text: str) -> list[dict[str, Any]]:
    """Return the rows of answers.csv; cells that hold JSON tables are read."""
    frame = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    frame.columns = [c.strip().lower() for c in frame.columns]
    missing = [c for c in ("id", "block", "effect") if c not in frame]
    if missing:
        raise ParameterError(
            f"withheld: answers.csv lacks the column {missing[0]!r}; it has"
            f" {', '.join(frame.columns)}"
        )
    return [{str(k): _cell(v) for k, v in row.items()} for row in frame.to_dict("records")]


def _cell(value: str) -> Any:
    if value.startswith("{"):
        try:
            return json.loads(value)
        except ValueError:
            return value
    return value


def _published(folder: Path) -> str:
    return (folder / COMMITMENT).read_text(encoding="utf-8").strip()
