"""Commit to answers before an exam is opened, and tell afterwards which of them came in time.

Whoever answers lists the SHA-256 of the answers in the exam's folder; whoever opens the exam keeps
beside the key when that was. Answers that were not listed before the first opening may have been
written by somebody who had seen the labels.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from simbench.detectors.errors import ParameterError, printable
from simbench.files import plain_bytes, refuse_own_input
from simbench.sealed.exam.answers import read_answers
from simbench.sealed.exam.folder import Exam, read_exam, table_rows

COMMITMENTS, OPENINGS = "commitments.csv", "opened.csv"
_COMMITMENT = ("sha256", "name", "time")
_OPENING = ("time", "answers", "exam")


def commit_answers(answers: str | Path, folder: str | Path) -> str:
    """Append the SHA-256 of a file of answers to `commitments.csv` of an exam, and return it.

    Parameters
    ----------
    answers : str or Path
        File of answers; its content is checked as `exam open` checks it.
    folder : str or Path
        Folder of the exam.

    Returns
    -------
    str
        SHA-256 of the file, 64 hex digits. Answers that are listed already are not listed again.

    Raises
    ------
    ParameterError
        When the folder holds no exam, or the file what is no answer to it.

    Examples
    --------
    >>> import tempfile
    >>> from simbench.sealed.exam.making import make_exam
    >>> with tempfile.TemporaryDirectory() as place:
    ...     _ = make_exam("smoke", f"{place}/exam", f"{place}/exam.key", n=1)
    ...     name = next(iter(read_exam(f"{place}/exam").records))
    ...     mine = Path(place, "mine.csv")
    ...     _ = mine.write_text(f"method,record,verdict,score\\nmine,{name},stiction,0.7\\n")
    ...     mark = commit_answers(mine, f"{place}/exam")
    ...     mark in Path(place, "exam", COMMITMENTS).read_text()
    True
    """
    exam, answers = read_exam(folder), Path(answers)
    read_answers([answers], exam.records)
    mark = _mark(answers)
    if mark not in _committed(exam):
        _append(exam.file(COMMITMENTS), _COMMITMENT, (mark, printable(answers.name), _now()))
    return mark


def answered_late(exam: Exam, key: Path, answers: Iterable[Path]) -> list[Path]:
    """Return the files of answers that were not committed to before the exam was first opened."""
    openings = _rows(key.with_name(OPENINGS), _OPENING)
    first = min((row["time"] for row in openings if row["exam"] == _name(exam)), default=_now())
    committed = _committed(exam)
    return [file for file in answers if committed.get(_mark(file), first) >= first]


def note_opening(exam: Exam, key: Path, answers: Iterable[Path]) -> None:
    """Append this opening of an exam to `opened.csv` beside its key."""
    names = " ".join(printable(file.name) for file in answers)
    _append(key.with_name(OPENINGS), _OPENING, (_now(), names, _name(exam)))


def _name(exam: Exam) -> str:
    return str(exam.about["commitment"])


def _committed(exam: Exam) -> dict[str, str]:
    """Return when answers were committed to first, by their SHA-256."""
    times: dict[str, str] = {}
    for row in _rows(exam.file(COMMITMENTS), _COMMITMENT):
        times.setdefault(row["sha256"], row["time"])
    return times


def _rows(file: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    return [row for _, row in table_rows(file, columns)] if file.exists() else []


def _mark(file: Path) -> str:
    try:
        return hashlib.sha256(plain_bytes(file)).hexdigest()
    except OSError as error:
        raise ParameterError(f"exam: {file} cannot be read: {error.strerror}") from None


def _now() -> str:
    # all of one form, so that their order as texts is their order in time
    return datetime.now(UTC).isoformat(timespec="microseconds")


def _append(file: Path, columns: Sequence[str], row: Sequence[str]) -> None:
    """Append one row: whoever commits at the same time loses nothing."""
    refuse_own_input([file], [])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([row] if file.exists() else [columns, row])
    try:
        with open(file, "a", encoding="utf-8") as f:
            f.write(text.getvalue())
    except OSError as error:
        raise ParameterError(f"exam: {file} cannot be written: {error.strerror}") from None
