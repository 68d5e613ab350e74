"""Read the answers that a program in any language wrote about the records of a run."""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Collection, Iterator
from pathlib import Path

import pandas as pd

from simbench.detectors.errors import ParameterError, nearest
from simbench.detectors.plugins.registry import RESERVED
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.verdict import VERDICTS, Level, Verdict, in_data
from simbench.files import plain_bytes

_NEEDED = ("method", "record", "verdict")
_OPTIONAL = ("score", "S", "J")
_NAME = re.compile(r"[A-Za-z][\w.@-]{0,59}", re.ASCII)
_LARGEST = 1e6  # of S and J; the travel of a valve is 100 %
_SEPARATORS = (",", ";", "\t")  # of the cells of a line
_BETWEEN = ".."  # the ends of an interval
Answers = dict[str, dict[str, Verdict]]  # by method and record


def read_answers(file: str | Path, records: Collection[str]) -> Answers:
    """Read a file of answers.

    Parameters
    ----------
    file : str or Path
        CSV with the columns method, record and verdict (stiction, no_stiction or no_decision), and
        if wanted score (larger means stickier), S and J (% of travel: a number, or an interval such
        as 2.5..4); an empty cell is no number. Cells may be apart by semicolons or tabs, and
        numbers then have a decimal comma.
    records : collection of str
        Ids of the records that were handed out.

    Returns
    -------
    dict of str to dict of str to Verdict
        By method and record.

    Raises
    ------
    ParameterError
        Naming file and line, for an unknown record, an unknown verdict, a second answer, or the
        name of a method of the package.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     file = Path(place, "mine.csv")
    ...     _ = file.write_text("method,record,verdict\\nmine,a1,stiction\\n")
    ...     read_answers(file, ["a1", "b2"])["mine"]["a1"].verdict
    'stiction'
    """
    # Line by line: a known record and a name that is free
    answers: Answers = {}
    lines: dict[tuple[str, str], int] = {}
    for line, row in _read_rows(Path(file)):
        where = f"{file}, line {line}"
        method = row["method"]
        record = row["record"]
        if method not in answers:
            _refuse_name(where, method)
        if record not in records:
            raise ParameterError(
                f"{where}: the run has no record {record[:80]!r}: {nearest(record, records)}"
            )

        # A verdict of the vocabulary, once a record and method
        row["verdict"] = in_data(row["verdict"])
        if row["verdict"] not in VERDICTS:
            raise ParameterError(
                f"{where}: {row['verdict'][:80]!r} is no verdict; allowed: {', '.join(VERDICTS)}"
            )
        if (method, record) in lines:
            raise ParameterError(
                f"{where}: {method} answered record {record!r} before, in line"
                f" {lines[method, record]}; once is allowed"
            )
        lines[method, record] = line

        # Score and sizes, where they are given
        if row["score"]:
            score = _read_number(row["score"], where, "score")
        else:
            score = math.nan
        S = _read_level(row["S"], where, "S")
        J = _read_level(row["J"], where, "J")
        answers.setdefault(method, {})[record] = Verdict(
            method, row["verdict"], score, S=S, J=J, reason="as answered"
        )

    # A file without answers is a mistake
    if not answers:
        raise ParameterError(f"{file} has no answers; a line for each method and record is needed")
    return answers


def _read_rows(file: Path) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield the rows of the file by column, each with its line; columns that are not there are
    empty.
    """
    # commas, or what spreadsheets of other countries write in their place, with decimal commas
    try:
        content = plain_bytes(file)
        head = content.partition(b"\n")[0].decode("utf-8-sig")
        separator = max(_SEPARATORS, key=head.count)
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # of cells beyond the header
            table = pd.read_csv(
                io.BytesIO(content),
                sep=separator,
                dtype=str,
                keep_default_na=False,
                skip_blank_lines=False,
                index_col=False,
                encoding="utf-8-sig",
            )
    except OSError as error:
        raise ParameterError(f"{file} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ParameterError(f"{file} is no text in UTF-8, which is needed") from None
    except (ValueError, pd.errors.ParserWarning) as error:  # errors of pandas are ValueErrors
        reason = str(error).strip().splitlines()[-1]
        raise ParameterError(f"{file} is no table of answers ({reason}); CSV is needed") from None

    # the columns that are needed, and what else there may be
    table.columns = [str(name).strip() for name in table.columns]
    header = list(table.columns)
    wrong = [name for name in header if name not in (_NEEDED + _OPTIONAL)]
    if wrong or not set(_NEEDED) <= set(header) or len(set(header)) < len(header):
        raise ParameterError(
            f"{file}, line 1: the columns are {', '.join(header)[:200]}; needed:"
            f" {', '.join(_NEEDED)} and, if wanted, {', '.join(_OPTIONAL)}"
        )
    table = table.fillna("").reindex(columns=list(_NEEDED) + list(_OPTIONAL), fill_value="")

    # Numbers with a decimal comma
    if separator != ",":
        sizes = list(_OPTIONAL)
        table[sizes] = table[sizes].apply(lambda cells: cells.str.replace(",", "."))

    # Each row that holds anything, with its line
    for line, cells in enumerate(table.itertuples(index=False), start=2):
        row = {}
        for name, cell in zip(table.columns, cells, strict=True):
            row[name] = cell.strip()
        if any(row.values()):
            yield line, row


def _refuse_name(where: str, method: str) -> None:
    """Refuse what is no name of a method, and what can be taken for a method of the package."""
    if not _NAME.fullmatch(method) or method in RESERVED:
        allowed = (
            "a letter of a to z, then such letters, digits, _ . @ or -, and no name of a reference"
            " row"
        )
        raise ParameterError(f"{where}: {method[:80]!a} is no name of a method; allowed: {allowed}")
    plain = method.lower().replace("-", "_").partition("@")[0].strip("_.")
    if registry.built_in(plain):
        raise ParameterError(
            f"{where}: {method!r} is taken for {plain!r} of the package, which `--add --method"
            f" {plain}` asks; another name is needed"
        )


def _read_number(text: str, where: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(
            f"{where}: {name} = {text[:80]!r}; a number or an empty cell is needed"
        ) from None


def _read_level(text: str, where: str, name: str) -> Level:
    """Return the size in a cell: a number, the ends of an interval, or None."""
    if not text or text.lower() == "nan":
        return None
    ends = [_read_number(part, where, name) for part in text.split(_BETWEEN, 1)]
    if not 0.0 <= ends[0] <= ends[-1] <= _LARGEST:
        raise ParameterError(
            f"{where}: {name} = {text[:80]!r}; a size from 0 to {_LARGEST:g}, or"
            f" lo{_BETWEEN}hi, is needed"
        )
    if len(ends) == 1:
        return ends[0]
    return (ends[0], ends[1])
