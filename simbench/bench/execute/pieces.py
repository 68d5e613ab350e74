"""Write the results of one piece of a run as table partitions, and join them at the end; only a
short receipt travels between processes.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from simbench.bench.execute.compute_piece import Piece, Receipt
from simbench.bench.execute.lease import lease
from simbench.bench.score.result import Scores
from simbench.bench.score.scoring import score_book
from simbench.bench.store.benchmark import BENCHMARK, benchmark_of, grid_of
from simbench.bench.store.checksums import (
    TABLE_KINDS,
    TABLES,
    RunError,
    digest,
    partition,
    with_checksum,
    without_checksum,
)
from simbench.bench.store.manifest import MANIFEST, read_manifest, refuse_to_mix, write_manifest
from simbench.bench.store.place import Place, place_of
from simbench.bench.store.reading import RunArrays
from simbench.files import folder as make_folder
from simbench.files import record_text

_RECEIPTS = "receipts"


def held(place: Place) -> AbstractContextManager[None]:
    """Hold a run's folder alone, where it is one of a file system."""
    if place.local is None:
        return contextlib.nullcontext()
    return lease(
        make_folder(place.local), ("", _RECEIPTS, *(f"{kind}.parquet" for kind in TABLE_KINDS))
    )


def open_run(path: str | Path | Place, manifest: dict[str, Any], resume: bool) -> Place:
    """Make or reopen a run's folder."""
    place = place_of(path)
    there = place.names()
    if not there:
        write_manifest(place, manifest)
    elif MANIFEST not in there:
        raise RunError(f"folder {place} is not empty and holds no run; choose another")
    elif not resume:
        raise RunError(
            f"folder {place} already holds a run; continue it with --resume, or choose another"
            " folder"
        )
    else:
        refuse_to_mix(place, manifest)
    return place


def write_piece(place: Place, piece: Piece, key: str) -> Receipt:
    """Put a finished piece on disk; it counts from the moment its receipt, the last file, is
    complete.
    """
    receipt = piece.receipt
    there = find_receipt(place, receipt.piece, key)
    if there is not None:  # somebody believed dead was only slow
        return there
    for ident, record in piece.kept.items():
        place.write(f"records/{ident}.csv", record_text(record).encode())
    for kind, content in piece.tables.items():
        place.write(partition_file(kind, receipt.piece), content)
    stated = {"run": key, **asdict(receipt)}
    place.write(receipt_file(receipt.piece), json.dumps(with_checksum(stated)).encode())
    if find_receipt(place, receipt.piece, key) is None:
        raise RunError(f"{place}: what is written there reads back otherwise; is the disk sound?")
    return receipt


def find_receipt(place: Place, number: int, key: str) -> Receipt | None:
    """Return the receipt of a piece of this run when all its files stand there, bit for bit as they
    were written.
    """
    try:
        content = without_checksum(json.loads(place.read(receipt_file(number))), "receipt")
        if (content["run"], content["piece"]) != (key, number):
            return None
        if any(
            digest(place.read(partition_file(kind, number))) != content["marks"][kind]
            for kind in TABLE_KINDS
        ):
            return None
        return Receipt(
            **{f.name: content[f.name] for f in fields(Receipt) if f.name != "reused"}, reused=True
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, RunError):
        return None


def finish(place: Place, receipts: Sequence[Receipt], manifest: dict[str, Any]) -> Scores:
    """Score a run whose pieces are all there, say in its manifest that it is whole, and return the
    scores.
    """
    for kind in TABLE_KINDS:
        lacking = {partition(r.piece) for r in receipts} - set(place.names(f"{kind}.parquet"))
        if lacking:
            raise RunError(
                f"{place}/{kind}.parquet lacks {min(lacking)}, which a worker wrote; name a place"
                " that all reach"
            )
    scenarios, errors = (
        sum(getattr(r, name) for r in receipts) for name in ("scenarios", "failures")
    )
    whole = {
        **manifest,
        "complete": True,
        "counts": {
            "scenarios": scenarios,
            "verdicts": scenarios * len(manifest["methods"]),
            "errors": errors,
        },
        TABLES: marks_of(receipts),
    }
    book = RunArrays.read(place, whole)
    whole["records_hash"] = records_hash(book)
    whole[BENCHMARK] = benchmark_of(grid_of(manifest), book.table)
    scores = score_book(book)
    scores.write(place)
    write_manifest(place, whole)
    place.remove(_RECEIPTS)
    return scores


def records_hash(book: RunArrays) -> str:
    """Return 16 hex digits of all records of a run, in order."""
    return digest(np.where(book.hashes == b"", b"-", book.hashes).tobytes().replace(b"\0", b""))


def marks_of(receipts: Sequence[Receipt]) -> dict[str, list[str]]:
    """Return the checksums of both tables' partitions, as a manifest holds them."""
    return {kind: [r.marks[kind] for r in receipts] for kind in TABLE_KINDS}


def is_finished(place: Place) -> bool:
    """Whether a run is whole; what a kill left of its receipts goes."""
    finished = bool(read_manifest(place)["complete"])
    if finished:
        place.remove(_RECEIPTS)
    return finished


def standing(place: Place) -> str:
    """Return how many pieces of a run are whole, and how to go on."""
    return f"{len(place.names(_RECEIPTS))} pieces are whole in {place}; continue with --resume"


def receipt_file(number: int) -> str:
    """Return the name of the receipt of a piece."""
    return f"{_RECEIPTS}/{number:08d}.json"


def partition_file(kind: str, number: int) -> str:
    """Return the name of the file of one table of a piece."""
    return f"{kind}.parquet/{partition(number)}"
