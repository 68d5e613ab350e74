"""Write the results of one piece of a run as table partitions, and join them at the end; only a
short receipt travels between processes.
"""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from simbench.bench.execute.compute_piece import Piece, Receipt
from simbench.bench.score.result import Scores
from simbench.bench.score.scoring import score_book
from simbench.bench.store.benchmark import BENCHMARK, benchmark_of, grid_of
from simbench.bench.store.folder import (
    PIECES,
    TABLE_KINDS,
    RunError,
    digest,
    file_digest,
    partition_file,
    visible_names,
    write_file,
)
from simbench.bench.store.manifest import (
    MANIFEST,
    put_in_place,
    read_manifest,
    refuse_to_mix,
    run_key,
    write_manifest,
)
from simbench.bench.store.reading import RunArrays
from simbench.files import FileError, remove_stale_temporaries
from simbench.files import folder as make_folder

_RECEIPTS = "receipts"
_LOCK = ".lock"


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a run's folder alone, and remove what killed processes left half-written in it; RunError
    where another process holds it.
    """
    # the lock, in the folder
    was_there = folder.exists()
    lock = FileLock(make_folder(folder) / _LOCK)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise RunError(
            f"{folder} is in use: another simbench works there; wait for its end"
        ) from None
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise FileError(f"{folder / _LOCK} cannot be written: {why}") from error

    # what was begun there, and then the caller's work
    try:
        for name in ("", _RECEIPTS, *(f"{kind}.parquet" for kind in TABLE_KINDS)):
            remove_stale_temporaries(folder / name)
        put_in_place(folder)
        yield
    finally:
        (folder / _LOCK).unlink(missing_ok=True)
        lock.release()
        if not was_there:
            with contextlib.suppress(OSError):  # which was used
                folder.rmdir()


def open_run(folder: Path, manifest: dict[str, Any], resume: bool) -> None:
    """Make or reopen a run's folder."""
    there = visible_names(folder)
    if not there:
        write_manifest(folder, manifest)
    elif MANIFEST not in there:
        raise RunError(f"folder {folder} is not empty and holds no run; choose another")
    elif not resume:
        raise RunError(
            f"folder {folder} already holds a run; continue it with --resume, or choose another"
            " folder"
        )
    else:
        refuse_to_mix(folder, manifest)


def write_piece(folder: Path, piece: Piece, key: str) -> Receipt:
    """Put a finished piece on disk; it counts from the moment its receipt, the last file, is
    complete.
    """
    _refuse_gone(folder)

    # somebody believed dead was only slow
    receipt = piece.receipt
    there = find_receipt(folder, receipt.piece, key)
    if there is not None:
        return there

    # the tables first
    for kind, content in piece.tables.items():
        write_file(folder / partition_file(kind, receipt.piece), content)
    _write_receipt(folder, asdict(receipt), key)
    return receipt


def _write_receipt(folder: Path, receipt: dict[str, Any], key: str) -> None:
    """Write what a piece holds, and the run that it is of."""
    stated = {"run": key, **receipt}
    write_file(folder / _receipt_file(receipt["piece"]), json.dumps(stated).encode())


def _refuse_gone(folder: Path) -> None:
    """Raise RunError where a run's folder is there no longer: what is written would found another
    one.
    """
    if not (folder / MANIFEST).is_file():
        raise RunError(
            f"{folder} holds no {MANIFEST} any more, so the run ends: the folder was removed or"
            " moved while the run went on, or a worker does not reach it"
        )


def find_receipt(folder: Path, number: int, key: str) -> Receipt | None:
    """Return the receipt of a piece of this run when the piece is whole and as it was written."""
    # of this run and number, with the files that it states; whatever is damaged makes it none
    try:
        content = json.loads((folder / _receipt_file(number)).read_bytes())
        if (content["run"], content["piece"]) != (key, number):
            return None
        if digests_of_piece(folder, number) != content["digests"]:
            return None
        return Receipt(
            **{f.name: content[f.name] for f in fields(Receipt) if f.name != "reused"}, reused=True
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def digests_of_piece(folder: Path, number: int) -> dict[str, str]:
    """Return the digests of the files of a piece, by table."""
    return {kind: file_digest(folder / partition_file(kind, number)) for kind in TABLE_KINDS}


def finish(folder: Path, receipts: Sequence[Receipt], manifest: dict[str, Any]) -> Scores:
    """Score a run whose pieces are all there, say in its manifest that it is whole, and return the
    scores.
    """
    # every piece that a worker wrote is here
    for number, kind in product((r.piece for r in receipts), TABLE_KINDS):
        if not (folder / partition_file(kind, number)).exists():
            raise RunError(
                f"{folder} lacks {partition_file(kind, number)}, which a worker wrote; name a"
                " folder that all reach"
            )

    # what the manifest states of the whole
    scenarios = sum(receipt.scenarios for receipt in receipts)
    whole = {
        **manifest,
        "complete": True,
        "counts": {
            "scenarios": scenarios,
            "verdicts": scenarios * len(manifest["methods"]),
            "errors": sum(receipt.failures for receipt in receipts),
        },
        PIECES: [asdict(receipt) for receipt in receipts],
    }
    book = RunArrays.read(folder, whole)
    whole["records_hash"] = records_hash(book)
    whole[BENCHMARK] = benchmark_of(grid_of(manifest), book.table)

    # the scores, and last the manifest
    scores = score_book(book)
    scores.write(folder)
    write_manifest(folder, whole)
    shutil.rmtree(folder / _RECEIPTS, ignore_errors=True)
    return scores


def records_hash(book: RunArrays) -> str:
    """Return 16 hex digits of all records of a run, in order."""
    return digest(np.where(book.hashes == b"", b"-", book.hashes).tobytes().replace(b"\0", b""))


def is_finished(folder: Path) -> bool:
    """Whether a run is whole, and each of its pieces as it was written; if not, the receipts of
    those that are make it one that goes on.
    """
    manifest = read_manifest(folder)
    if not manifest["complete"]:
        return False

    # the receipts as they were before the run was whole
    key = run_key(manifest)
    stated = manifest.get(PIECES, ())
    for receipt in stated:
        _write_receipt(folder, receipt, key)

    # all of the pieces are as they state, or the others are computed again
    whole = all(find_receipt(folder, receipt["piece"], key) for receipt in stated)
    if whole:
        shutil.rmtree(folder / _RECEIPTS, ignore_errors=True)
    else:
        write_manifest(folder, {**manifest, "complete": False})
    return whole


def standing(folder: Path) -> str:
    """Return how many pieces of a run are whole, and how to go on."""
    whole = len(visible_names(folder / _RECEIPTS))
    return f"{whole} pieces are whole in {folder}; continue with --resume"


def _receipt_file(number: int) -> str:
    return f"{_RECEIPTS}/{number:08d}.json"
