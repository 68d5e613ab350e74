"""Encrypt the answers of a blind test; a commitment (checksum) proves later that they were not
changed.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from dataclasses import dataclass
from pathlib import Path

from simbench.detectors.errors import ParameterError
from simbench.sealed.handout import commitment_of, matches, read_key, write_key
from simbench.sealed.withheld.outcomes import write_whole

SEALED, COMMITMENT = "answers.sealed", "commitment.txt"


@dataclass(frozen=True)
class _Sealed:
    """Sealed bytes with the key that opens them."""

    content: bytes  # ciphertext
    # key, salt: 32 random bytes each
    key: bytes
    salt: bytes
    commitment: str  # SHA-256 (hex) of salt followed by the plain text


def seal(text: str) -> _Sealed:
    """Seal a text under a fresh random key.

    The cipher is a one-time key stream: SHAKE-256 of the key, which is never used again.

    >>> s = seal("id,effect")
    >>> _unseal(s.content, s.key, s.salt, s.commitment)
    'id,effect'
    """
    key, salt, plain = secrets.token_bytes(32), secrets.token_bytes(32), text.encode()
    return _Sealed(_mix(plain, key), key, salt, commitment_of(salt + plain))


def _unseal(content: bytes, key: bytes, salt: bytes, commitment: str) -> str:
    """Open sealed bytes and check them against the commitment."""
    plain = _mix(content, key)
    if not matches(salt + plain, commitment):
        raise ParameterError(
            "withheld: the answers do not match the commitment; they, the key or the commitment"
            " were changed"
        )
    return plain.decode()


def write(sealed: _Sealed, folder: Path, key: Path) -> None:
    """Write sealed answers and commitment into the folder, and the key into another file readable
    by its owner only.
    """
    secret = {"key": sealed.key.hex(), "salt": sealed.salt.hex(), "commitment": sealed.commitment}
    published = {
        folder / SEALED: sealed.content,
        folder / COMMITMENT: f"{sealed.commitment}\n".encode(),
    }
    for file, content in published.items():
        write_whole(file, content)
    write_key(key, json.dumps(secret).encode())


def is_key_of(key: Path, folder: Path) -> bool:
    """Return whether a file is the key to the answers sealed in a folder."""
    try:
        published = (folder / COMMITMENT).read_text(encoding="utf-8").strip()
        return json.loads(key.read_text(encoding="utf-8"))["commitment"] == published
    except (OSError, ValueError, KeyError, TypeError):
        return False


def read(folder: Path, key: Path) -> str:
    """Return the text of answers.csv from a sealed folder and its key."""
    parts = read_key("withheld", key)[1]
    try:
        content = (folder / SEALED).read_bytes()
        published = (folder / COMMITMENT).read_text(encoding="utf-8").strip()
        secret, salt = bytes.fromhex(parts["key"]), bytes.fromhex(parts["salt"])
    except OSError as error:
        raise ParameterError(
            f"withheld: {error.filename} cannot be read: {error.strerror}"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise ParameterError(f"withheld: {key} is no key file") from None
    if published != parts.get("commitment"):
        raise ParameterError(
            f"withheld: the commitment in {folder} is not the one of the key {key}"
        )
    return _unseal(content, secret, salt, published)


def _mix(data: bytes, key: bytes) -> bytes:
    stream = hashlib.shake_256(b"answers" + key).digest(len(data))
    return bytes(a ^ b for a, b in zip(data, stream, strict=True))
