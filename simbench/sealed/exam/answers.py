"""Read and check the file of answers to an exam, which a program in any language may write."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterable
from pathlib import Path

from simbench.detectors.errors import ParameterError, nearest
from simbench.detectors.plugins.registry import RESERVED
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.report.summary import level_ends
from simbench.detectors.verdict import VERDICTS, Level, Verdict
from simbench.sealed.exam.folder import table_rows

NEEDED, OPTIONAL = ("method", "record", "verdict", "score"), ("S", "J")
_NAME = re.compile(r"[A-Za-z][\w.@-]{0,59}", re.ASCII)
_LARGEST = 1e6  # of S and J; the travel of a valve is 100 %
_BETWEEN = ".."  # the ends of an interval
Answers = dict[str, dict[str, Verdict]]  # by method and record


def rows_of(record: str, verdicts: Iterable[Verdict]) -> str:
    """Return the lines of the answers to one record."""
    text = io.StringIO()
    rows = (
        (
            v.method,
            record,
            v.verdict,
            _cell((v.score,) * 2),
            *map(_cell, map(level_ends, (v.S, v.J))),
        )
        for v in verdicts
    )
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def read_answers(files: Iterable[Path], records: Collection[str]) -> Answers:
    """Read files of answers; raise ParameterError, naming file and line, for a line that answers no
    record of the exam.
    """
    answers: Answers = {}
    first: dict[tuple[str, str], str] = {}
    for file in files:
        rows = table_rows(file, NEEDED, OPTIONAL)
        if not rows:
            raise ParameterError(
                f"exam: {file} has no answers; a line for each method and record is needed"
            )
        for line, row in rows:
            where, method, record = f"{file}, line {line}", row["method"], row["record"]
            if not _NAME.fullmatch(method) or method in RESERVED:
                allowed = (
                    "a letter of a to z, then such letters, digits, _ . @ or -, and no name of a"
                    " reference row"
                )
                raise ParameterError(
                    f"exam: {where}: {method[:80]!a} is no name of a method; allowed: {allowed}"
                )
            if (package := _likeness(method)) is not None:
                raise ParameterError(
                    f"exam: {where}: {method!r} can be taken for {package!r} of the package;"
                    " another name is needed"
                )
            if record not in records:
                raise ParameterError(
                    f"exam: {where}: the exam has no record {record[:80]!r}:"
                    f" {nearest(record, records)}"
                )
            if row["verdict"] not in VERDICTS:
                raise ParameterError(
                    f"exam: {where}: {row['verdict'][:80]!r} is no verdict; allowed:"
                    f" {', '.join(VERDICTS)}"
                )
            if (method, record) in first:
                before = first[method, record]
                raise ParameterError(
                    f"exam: {where}: {method} answered record {record!r} before, in {before}; once"
                    " is allowed"
                )
            first[method, record] = where
            score = _number(row["score"], where, "score") if row["score"] else math.nan
            S, J = (_level(row.get(name, ""), where, name) for name in OPTIONAL)
            verdict = Verdict(method, row["verdict"], score, S=S, J=J, reason="as answered")
            answers.setdefault(method, {})[record] = verdict
    return answers


def _likeness(method: str) -> str | None:
    """Return the method of the package that a name pretends to be a form of; None where it is that
    method itself, which is asked again, or of another name.

    >>> _likeness("HE"), _likeness("horch@mine"), _likeness("he"), _likeness("helen")
    ('he', 'horch', None, None)
    """
    if method in registry.every_name() or method in registry.variants():
        return None
    name = method.lower().replace("-", "_").partition("@")[0].strip("_.")
    return name if registry.built_in(name) else None


def _cell(ends: tuple[float, float]) -> str:
    texts = [repr(float(end)) for end in ends]
    return "" if math.isnan(ends[0]) else _BETWEEN.join(dict.fromkeys(texts))


def _number(text: str, where: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(
            f"exam: {where}: {name} = {text[:80]!r}; a number or an empty cell is needed"
        ) from None


def _level(text: str, where: str, name: str) -> Level:
    if not text or text.lower() == "nan":
        return None
    ends = [_number(part, where, name) for part in text.split(_BETWEEN, 1)]
    if not 0.0 <= ends[0] <= ends[-1] <= _LARGEST:
        raise ParameterError(
            f"exam: {where}: {name} = {text[:80]!r}; a size from 0 to {_LARGEST:g}, or"
            f" lo{_BETWEEN}hi, is needed"
        )
    return ends[0] if len(ends) == 1 else (ends[0], ends[1])
