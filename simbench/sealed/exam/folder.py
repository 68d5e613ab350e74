"""Write and read the folder of an exam: records, what an engineer would know of each loop, and the
commitment (checksum of the key).
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from simbench.detectors.errors import ParameterError, RecordError, UserError, naming
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.tables import MOST_PARQUET_BYTES, parquet_sizes
from simbench.files import plain_bytes, whole_file

EXAM_FORMAT = 1
EXAM, LOOPS, RECORDS = "exam.json", "loops.csv", "records.parquet"
_SIGNALS = ("t", "sp", "op", "pv")
_KNOWN = ("record", "Ts", "process", "op_lo", "op_hi")
_STATED = {"format": int, "benchmark": dict, "version": int, "n": int, "commitment": str}


class Exam(NamedTuple):
    """An exam as it lies in its folder."""

    folder: Path
    about: dict[str, Any]  # content of exam.json
    records: dict[str, LoopRecord]  # by id, in the order of the files
    marks: dict[str, str]  # digest of each record with its times and what is known of its loop

    def file(self, name: str) -> Path:
        """Return one of the exam's files."""
        return self.folder / name


def write_exam(folder: Path, about: Mapping[str, Any], records: Mapping[str, LoopRecord]) -> None:
    """Write the three files of an exam; `about` is the content of exam.json."""
    columns = {
        name: np.concatenate([getattr(r, name) for r in records.values()]) for name in _SIGNALS
    }
    ids = pa.array(np.repeat(list(records), [r.n for r in records.values()]))
    with whole_file(folder / RECORDS, "wb") as f:
        pq.write_table(pa.table({"record": ids, **columns}), f, compression="zstd")
    with whole_file(folder / LOOPS) as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerows(
            [
                _KNOWN,
                *((name, r.Ts, r.process, *(r.op_span or ("", ""))) for name, r in records.items()),
            ]
        )
    with whole_file(folder / EXAM) as f:
        f.write(json.dumps(about, indent=1) + "\n")


def read_exam(folder: str | Path) -> Exam:
    """Read an exam; ParameterError, naming file and line, where it is damaged."""
    folder = Path(folder)
    about = _stated(folder / EXAM)
    loops = _loops(folder / LOOPS)
    parts = _signals(folder / RECORDS)
    for here, there, file in ((loops, parts, RECORDS), (parts, loops, LOOPS)):
        for name in (name for name in here if name not in there):
            raise ParameterError(
                f"exam: {folder / file} has no record {name!r}; the whole file is needed"
            )
    if len(loops) != about["n"]:
        raise ParameterError(
            f"exam: {folder / LOOPS} has {len(loops)} records; {about['n']} are needed, as {EXAM}"
            " states"
        )
    records, marks = {}, {}
    for name, known in loops.items():
        t, sp, op, pv = parts[name]
        with naming(f"exam: {folder}, record {name!r}"):
            records[name] = record = LoopRecord(sp=sp, op=op, pv=pv, **known)
        marks[name] = mark_of(record, t)
    return Exam(folder, about, records, marks)


def mark_of(record: LoopRecord, t: np.ndarray) -> str:
    """Return a digest of what an exam shows of a record, bit for bit; `t` are its times (s), shape
    (n,).
    """
    digest = hashlib.sha256(json.dumps([record.Ts, record.process, record.op_span]).encode())
    for signal in (t, record.sp, record.op, record.pv):
        digest.update(np.ascontiguousarray(signal, dtype=float).tobytes())
    return digest.hexdigest()


def _stated(file: Path) -> dict[str, Any]:
    try:
        with naming("exam"):
            content = plain_bytes(file)
        about = json.loads(content)
        wrong = [k for k, kind in _STATED.items() if not isinstance(about[k], kind)]
    except UserError:
        raise
    except OSError as error:
        raise ParameterError(
            f"exam: {file.parent} holds no exam: {EXAM} cannot be read ({error.strerror})"
        ) from None
    except (ValueError, KeyError, TypeError, RecursionError):
        wrong = [EXAM]
    if wrong:
        raise ParameterError(f"exam: {file} is damaged; JSON with {', '.join(_STATED)} is needed")
    if about["format"] != EXAM_FORMAT:
        raise ParameterError(
            f"exam: {file} has format {about['format']}; format {EXAM_FORMAT} is needed"
        )
    return about


def _loops(file: Path) -> dict[str, dict[str, Any]]:
    loops: dict[str, dict[str, Any]] = {}
    for line, row in table_rows(file, _KNOWN):
        span = row["op_lo"], row["op_hi"]
        try:
            known = {
                "Ts": float(row["Ts"]),
                "process": row["process"] or None,
                "op_span": tuple(map(float, span)),
            }
        except ValueError:
            raise ParameterError(
                f"exam: {file}, line {line}: Ts, op_lo and op_hi must be numbers; {row} is none"
            ) from None
        if row["record"] in loops:
            raise ParameterError(
                f"exam: {file}, line {line}: record {row['record']!r} is there twice; once is"
                " allowed"
            )
        loops[row["record"]] = known
    return loops


def _signals(file: Path) -> dict[str, np.ndarray]:
    """Return t, sp, op and pv of each record, shape (4, n)."""
    try:
        with naming("exam"):
            content = pa.BufferReader(plain_bytes(file, MOST_PARQUET_BYTES))
        _, size = parquet_sizes(pq.ParquetFile(content))
        if size > MOST_PARQUET_BYTES:
            limit = f"at most {MOST_PARQUET_BYTES / 1e6:.0f} MB are read"
            raise RecordError(f"exam: {file} unpacks to {size / 1e6:.0f} MB; {limit}")
        table = pq.read_table(content, columns=["record", *_SIGNALS])
        values = np.array([table.column(name).to_numpy().astype(float) for name in _SIGNALS])
        coded = table.column("record").combine_chunks().dictionary_encode()
    except UserError:
        raise
    except OSError as error:
        raise ParameterError(
            f"exam: {file} cannot be read: {error.strerror or 'it is damaged'}"
        ) from None
    except (pa.ArrowException, ValueError, KeyError, TypeError) as error:
        reason = str(error).splitlines()[0][:200]
        raise ParameterError(
            f"exam: {file} is damaged ({reason}); record, {', '.join(_SIGNALS)} are needed"
        ) from None
    codes = coded.indices.to_numpy()
    starts = np.flatnonzero(np.diff(codes, prepend=-1))
    ids = coded.dictionary.take(pa.array(codes[starts])).to_pylist()
    if len(set(ids)) < len(ids):
        raise ParameterError(
            f"exam: {file}: the samples of a record do not stand together, which is needed"
        )
    return dict(zip(ids, np.split(values, starts[1:], axis=1)))


def table_rows(
    file: Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()
) -> list[tuple[int, dict[str, str]]]:
    """Return the rows of a CSV file by column, each with its line; ParameterError, naming file and
    line, for any other file.
    """
    try:
        with naming("exam"):
            text = plain_bytes(file).decode("utf-8-sig")
    except OSError as error:
        raise ParameterError(f"exam: {file} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ParameterError(
            f"exam: {file}, line {line}: this is no text in UTF-8, which is needed"
        ) from None
    lines = text.splitlines(keepends=True)
    if not lines or lines[-1] == lines[-1].rstrip("\r\n"):
        raise ParameterError(
            f"exam: {file}, line {len(lines) or 1}: the file ends within a line; the whole file is"
            " needed"
        )
    reader, rows = csv.reader(lines, strict=True), []
    try:
        header = [cell.strip() for cell in next(reader)]
        wrong = [c for c in header if c not in (*needed, *optional)] + [
            c for c in needed if header.count(c) != 1
        ]
        if wrong or len(set(header)) < len(header):
            allowed = ", ".join(needed) + (
                f" and, if wanted, {', '.join(optional)}" if optional else ""
            )
            raise ParameterError(
                f"exam: {file}, line 1: the columns are {', '.join(header)[:200]}; needed:"
                f" {allowed}"
            )
        for row in reader:
            if row and len(row) != len(header):
                wanted = f"{len(row)} cells; {len(header)} are needed, as in line 1"
                raise ParameterError(f"exam: {file}, line {reader.line_num}: {wanted}")
            if row:
                rows.append((reader.line_num, dict(zip(header, (cell.strip() for cell in row)))))
    except csv.Error as error:
        raise ParameterError(
            f"exam: {file}, line {reader.line_num}: this is no CSV ({error})"
        ) from None
    return rows
