"""What plant historians export: units rows, states in place of numbers, quality columns, long tables, numbers as written."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from detectors.errors import RecordError
from detectors.records.roles import QUALITY, SIGNAL_WORDS, SIGNALS, TAG_COLUMNS, TIME_NAMES, VALUES, ends_with, unit, words
from detectors.records.tables import Sheet

_NEEDED = "a number, or nothing for unknown, is needed"
# what stands in place of a number when there is none
_NO_VALUE = {
    "bad", "no data", "nodata", "no good data", "bad input", "bad quality", "bad data", "i/o timeout", "io timeout",
    "comm fail", "calc failed", "pt created", "scan off", "shutdown", "configure", "intf shut", "arc off-line", "no result",
    "out of serv", "no sample", "not connect", "over range", "under range", "digital state", "nan", "null", "none", "n/a",
    "#n/a", "na", "-", "--", "---", "?", "1.#qnan", "-1.#ind", "1.#inf",
}  # fmt: skip
_GOOD, _BAD = {"good", "g", "ok", "valid", "true"}, {"bad", "b", "invalid", "false"}
_UNSURE = {"uncertain", "questionable", "doubtful", "u", "substituted", "annotated"}
_MILLIAMPERE = (4.0, 20.0)
_OTHER_SPANS = {"v", "volt", "bar", "mbar", "kpa", "psi", "psig", "mm", "deg", "rpm", "hz"}
_SENTINELS = (-99999.0, -9999.0, -999.25, -999.0, 9999.0, 99999.0)
_POINT = re.compile(r"[+-]?(\d+|\d{1,3}(,\d{3})+)?(\.\d*)?(e[+-]?\d+)?", re.IGNORECASE)
_APART = re.compile(r"(?<=\d)[\u00a0\u202f' ](?=\d{3})")  # what stands between thousands
_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}([.,]\d{3})+")  # numbers that may be whole, or have three decimals
_COMMA = re.compile(r"[+-]?(\d+|\d{1,3}(\.\d{3})+)?(,\d*)?(e[+-]?\d+)?", re.IGNORECASE)


def is_head(cells: Sequence[str], chosen: Mapping[str, str]) -> bool:
    """Whether some cells are the header of a record: PV and OP by name or choice, or time, tag and value.

    Examples
    --------
    >>> is_head(["Time", "MEAS", "OUT"], {}), is_head(["Export of 3 May", ""], {})
    (True, False)
    """
    names = [c.strip() for c in cells]
    named = {r for r in SIGNALS for n in names if means(n, r)} | {r for r, name in chosen.items() if name in names}
    return {"pv", "op"} <= named or long_columns(names) is not None


def take_units(sheet: Sheet, chosen: Mapping[str, str]) -> dict[str, str]:
    """Take rows of units or descriptions off the head of a table and return the units of its columns."""
    units = {name: unit(name) for name in sheet.columns}
    time = chosen.get("t") or next((n for n in sheet.columns if ends_with(n, TIME_NAMES) is not None), None)
    if not all(isinstance(c, list) for c in sheet.columns.values()):
        return units  # columns of numbers have no room for texts
    for _ in range(3):
        first = {n: str(c[0]).strip() for n, c in sheet.columns.items() if isinstance(c, list) and c}
        cells = [c for n, c in first.items() if n != time and c]
        clock = first.get(time, "") if time else ""
        if not cells or any(_numeric(c) or _state(c) for c in cells) or any(ch.isdigit() for ch in clock):
            break
        units |= {n: c.strip("[]() ").lower() for n, c in first.items() if c}
        for column in sheet.columns.values():
            del column[0]  # pyright: ignore[reportIndexIssue]
        sheet.notes.append(f"file: {sheet.place(0)} taken as units or descriptions: {', '.join(filter(None, first.values()))}")
        del sheet.lines[:1]
    return units


def op_span(unit_of_op: str, known: object, where: str, notes: list[str]) -> tuple[float, float] | None:
    """Return the span that OP's unit fixes; % is 0..100 by itself, 4..20 mA is a standard, others need to be told."""
    if known is not None:
        return None
    if unit_of_op == "ma":
        notes.append("unit: OP is in mA, 4 to 20 mA taken as 0 to 100 %")
        return _MILLIAMPERE
    if unit_of_op in _OTHER_SPANS:
        raise RecordError(f"{where}: OP is in {unit_of_op!r}; say which values mean 0 and 100 % (op_span)")
    return None


def read_numbers(sheet: Sheet, names: Sequence[str], where: str) -> dict[str, np.ndarray]:
    """Return columns as numbers; states such as "Bad" count as missing, and that is said.

    Examples
    --------
    >>> sheet = Sheet({"pv": ["1,5", "Bad", "2,25"]}, delimiter=";")
    >>> read_numbers(sheet, ["pv"], "FIC101.csv")["pv"], sheet.notes
    (array([1.5 ,  nan, 2.25]), ["status: 1 cells of pv say 'Bad' and count as missing"])
    """
    texts = {n: [_bare(v) for v in sheet.columns[n]] for n in names if not _is_numeric(sheet.columns[n])}
    out: dict[str, np.ndarray] = {n: np.asarray(sheet.columns[n], dtype=np.float64) for n in names if n not in texts}
    for name, column in texts.items():
        _refuse_thousands(column, name, where)
    comma = _decimal_comma([t for column in texts.values() for t in column if t], sheet, where)
    for name, column in texts.items():
        values = [_value(t, comma, i, name, sheet, where) for i, t in enumerate(column)]
        states = Counter(t for t, x in zip(column, values) if x != x and t and _state(t))
        out[name] = np.array(values, dtype=np.float64)
        sheet.notes += [f"status: {k} cells of {name} say {state!r} and count as missing" for state, k in states.items()]
    for name, x in out.items():
        infinite = np.flatnonzero(np.isinf(x))
        if infinite.size:
            row = int(infinite[0])
            raise RecordError(f"{where}, {sheet.place(row)}: {name} is infinite ({_cell(sheet, name, row)}); {_NEEDED}")
        _refuse_sentinels(x, name, where)
    return out


def apply_quality(sheet: Sheet, roles: Mapping[str, str], signals: Mapping[str, np.ndarray], where: str) -> None:
    """Blank the samples that a quality column calls bad."""
    for name, cells in sheet.columns.items():
        about = ends_with(name, QUALITY)
        if about is None or name in roles.values():
            continue
        mine = [r for r in signals if not about or means(" ".join(about), r) or words(roles[r]) == about]
        if not mine:
            continue
        bad, unsure, understood = _judged(cells, name, where)
        if not understood:
            sheet.notes.append(f"quality: column {name!r} is not understood and counts for nothing")
        for role in mine if bad.any() else ():
            signals[role][bad] = np.nan
        if bad.any():
            sheet.notes.append(f"quality: {int(bad.sum())} samples that {name!r} calls bad count as missing")
        if unsure:
            sheet.notes.append(f"quality: {unsure} samples that {name!r} calls uncertain are kept")


def long_columns(names: Sequence[str]) -> tuple[str, str, str] | None:
    """Return which columns of a long table are time, tag and value, None where it is not long."""
    low = {str(n).strip().lower().replace("_", " "): n for n in names}
    parts = [next((low[w] for w in among if w in low), None) for among in (TIME_NAMES, TAG_COLUMNS, VALUES)]
    return None if None in parts else (str(parts[0]), str(parts[1]), str(parts[2]))


def means(name: str, role: str) -> bool:
    """Whether a column's name says that it is this signal."""

    return ends_with(name, SIGNAL_WORDS[role]) is not None


def _bare(value: object) -> str:
    text = "" if value is None else str(value).strip()
    if text.isascii() and "'" not in text and " " not in text:
        return text
    return _APART.sub("", text) if text[:1].isdigit() or text[:1] in "+-" else text


def _is_numeric(column: object) -> bool:
    return isinstance(column, np.ndarray) and column.dtype.kind in "fiub"


def _numeric(text: str) -> bool:
    bare = _bare(text)
    return any(c.isdigit() for c in bare) and bool(_POINT.fullmatch(bare) or _COMMA.fullmatch(bare))


def _state(text: str) -> bool:
    low = text.lower()
    return low in _NO_VALUE or low.startswith("[-11059]")


def _decimal_comma(texts: Sequence[str], sheet: Sheet, where: str) -> bool:
    """Decide whether the comma is the decimal sign, by every number of the table together."""
    if not any("," in t and _numeric(t) for t in texts):
        return False
    found = [t for t in texts if ("," in t or "." in t) and _numeric(t)]
    point, comma = (all(rule.fullmatch(t) for t in found) for rule in (_POINT, _COMMA))
    if point and comma:
        if sheet.delimiter == ";" and not any("." in t for t in found):
            return True  # such files exist because the comma is taken
        example = next(t for t in found if "," in t)
        raise RecordError(
            f"{where}: {example!r} may be {example.replace(',', '.')} or {example.replace(',', '')}; write points"
        )
    if not point and not comma:
        one, other = (next(t for t in found if not rule.fullmatch(t)) for rule in (_POINT, _COMMA))
        raise RecordError(f"{where}: {one!r} has a decimal comma, {other!r} a decimal point; one of them is needed")
    if point:
        sheet.notes.append("numbers: commas separate thousands")
    return not point


def _refuse_thousands(column: Sequence[str], name: str, where: str) -> None:
    """Refuse 987 beside 1.012, which a program that separates thousands writes for 1012."""
    marked = [t for t in column if "," in t or "." in t]
    # most columns are told by their first number
    if any(not _GROUPS.fullmatch(t) and _numeric(t) for t in marked):
        return
    signed = [t for t in marked if _numeric(t)]
    plain = [abs(float(t)) for t in column if re.fullmatch(r"[+-]?[1-9]\d\d", t)]
    if signed and plain:
        read = [abs(float(t.replace(",", "."))) for t in signed if len(re.findall("[.,]", t)) == 1]
        # 514.503 beside 515 is a decimal point: as 514503 it would be another signal
        if read and min(read) > 0.1 * min(plain):
            return
        raise RecordError(
            f"{where}: {name} holds {signed[0]!r} beside whole numbers; it may be {re.sub('[.,]', '', signed[0])}"
        )


def _cell(sheet: Sheet, name: str, row: int) -> str:
    return str(sheet.columns[name][row]).strip()[:60]


def _value(text: str, comma: bool, row: int, name: str, sheet: Sheet, where: str) -> float:
    try:
        if "_" in text:  # which Python reads as nothing, and no plant writes in a number
            raise ValueError
        if comma:
            return float(text.replace(".", "").replace(",", ".")) if "," in text or _COMMA.fullmatch(text) else float(text)
        return float(text.replace(",", ""))
    except ValueError:
        if not text or _state(text):
            return np.nan
        raise RecordError(f"{where}, {sheet.place(row)}: {name} is {text!r}; {_NEEDED}") from None


def _refuse_sentinels(x: np.ndarray, name: str, where: str) -> None:
    known = x[np.isfinite(x)]
    for sentinel in _SENTINELS:
        rest = known[known != sentinel]
        if rest.size > 2 and rest.size < known.size and np.abs(rest - sentinel).min() > 10.0 * max(np.ptp(rest), 1.0):
            count, lo, hi = known.size - rest.size, rest.min(), rest.max()
            raise RecordError(
                f"{where}: {name} is {sentinel:g} in {count} samples and {lo:g} to {hi:g} otherwise; "
                "if that means no data, leave these cells empty"
            )


def _judged(cells: Sequence[object], name: str, where: str) -> tuple[np.ndarray, int, bool]:
    """Return which samples are bad, how many unsure, and whether the column speaks of quality at all."""
    texts = ["" if c is None else str(c).strip().lower() for c in cells]
    kinds = set(texts) - {""}
    codes = {t for t in kinds if re.fullmatch(r"\d+(\.0)?", t)}
    if codes and codes == kinds:
        numbers = [int(float(t)) if t else 192 for t in texts]
        if max(numbers) < 192 or max(numbers) > 255:
            raise RecordError(
                f"{where}: quality {name!r} holds {sorted(codes)[0]}; 0 to 255 with 192 as good is known, or words"
            )
        return np.array([q < 64 for q in numbers]), sum(64 <= q < 192 for q in numbers), True
    odd = sorted(kinds - _GOOD - _BAD - _UNSURE)
    if odd and len(odd) < len(kinds):
        raise RecordError(f"{where}: quality {name!r} says {odd[0]!r}; known: good, bad, uncertain")
    bad = np.array([t in _BAD for t in texts], dtype=bool)
    return bad & (not odd), 0 if odd else sum(t in _UNSURE for t in texts), not odd
