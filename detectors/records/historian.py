"""Read the exports of plant historians: rows of units, states in place of numbers, and number
formats.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.clock import is_stamped
from simbench.detectors.records.dialects import entries, words
from simbench.detectors.records.roles import (
    NONE,
    QUALITY_OF,
    ends_with,
    is_quality,
    is_time,
    parse,
    plain,
    unit,
    words_of,
)
from simbench.detectors.records.tables import BLANK, Sheet

_NEEDED = "a number, or nothing for unknown, is needed"
# words written in place of a missing number
_NO_VALUE = set(
    entries("""
    bad, no data, nodata, no good data, bad input, bad quality, bad data, i/o timeout, io timeout,
    comm fail, calc failed, pt created, scan off, shutdown, configure, intf shut, arc off-line,
    no result, out of serv, no sample, not connect, over range, under range, digital state, nan,
    null, none, n/a, #n/a, na, -, --, ---, ?, 1.#qnan, -1.#ind, 1.#inf, calc overflow, scan timeout,
    equip fail, unit down, invalid float, inp outrange, bad total, set to bad, data lost,
    not available, error, failed, #value!, #ref!, #div/0!, no value, off-scan, undefined, invalid
""")
)
_SENTINELS = (-99999.0, -9999.0, -999.25, -999.0, 9999.0, 99999.0)
_POINT = re.compile(r"[+-]?(\d+|\d{1,3}(,\d{3})+)?(\.\d*)?(e[+-]?\d+)?", re.IGNORECASE)
_APART = re.compile(r"(?<=\d)[\u00a0\u202f' ](?=\d{3})")  # separators of thousands
# a cell with its unit, as 12,3 m3/h or 12,3m3/h; 12e3 is a number with an exponent
_WITH_UNIT = re.compile(
    r"([+-]?\d[\d.,' ]*?)\s*((?!e[+-]?\d+$)(?:%|[^\W\d_]|°)[^\s]{0,7})", re.IGNORECASE
)
# what a quality says of a sample
_BAD = {*words("bad")}
# ... in a column of any name
_MARKS = {*words("good"), *words("unsure"), *_BAD} - {"true", "false"}
# ... in one that is called so: one of these first, as in "Good, Non-specific", or a code
_QUALITY = re.compile(rf"(?:{'|'.join(sorted(_MARKS))}|true|false|\d+)(?![^\W_])")
_SUMMARY = 12  # lines below a table that may sum it up
# numbers that may be whole, or have three decimals
_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}([.,]\d{3})+")
_COMMA = re.compile(r"[+-]?(\d+|\d{1,3}(\.\d{3})+)?(,\d*)?(e[+-]?\d+)?", re.IGNORECASE)

_SPANS = {
    "ma": ("mA", 4.0, 20.0),
    "m%": ("m%", 0.0, 1e5),
    "‰": ("‰", 0.0, 1e3),
}  # that a unit of OP fixes


_OTHER_SPANS = set(entries("v, volt, bar, mbar, kpa, psi, psig, mm, deg, rpm, hz, counts"))


_SHARE_OVER = 1.1  # what an output that is a share of 1 may read, 10 % over its range


_CURRENT = (3.5, 20.6)  # what an output of 4 to 20 mA may read


_LIKELY_SPANS = {
    "v": "1 5",
    "volt": "1 5",
    "bar": "0.2 1",
    "mbar": "200 1000",
    "kpa": "20 100",
    "psi": "3 15",
    "psig": "3 15",
}


_COUNTS = (
    (1023.0, "0 1023"),
    (4095.0, "0 4095"),
    (27648.0, "0 27648"),
    (32767.0, "0 32767"),
    (65535.0, "0 65535"),
)


def op_span(
    unit_of_op: str, known: object, op: np.ndarray, where: str, notes: list[str]
) -> tuple[float, float] | None:
    """Return the span that OP's unit fixes; % is 0..100 by itself, 4..20 mA is a standard, others
    must be given.
    """
    if known is not None:
        return None
    if unit_of_op in _SPANS:
        name, lo, hi = _SPANS[unit_of_op]
        notes.append(f"unit: OP is in {name}, {lo:g} to {hi:g} {name} taken as 0 to 100 %")
        return lo, hi
    if unit_of_op in _OTHER_SPANS:
        sentence = (
            f"{where}: OP is in {unit_of_op!r}; which values mean 0 and 100 % is needed (op_span)"
        )
        counts = next(
            (span for top, span in _COUNTS if unit_of_op == "counts" and np.nanmax(op) <= top),
            "0 100",
        )
        raise RecordError(sentence, f"--op-span {_LIKELY_SPANS.get(unit_of_op, counts)}")
    return None


def open_span(record: LoopRecord, where: str) -> list[str]:
    """Return the notes on an OP of unknown unit; a share of 1 is asked for, as %
    is 100 times as large.
    """
    if record.op_span is not None:
        return []
    lo = float(record.op.min())
    hi = float(record.op.max())
    runs = f"unit: OP runs from {lo:.4g} to {hi:.4g}"
    if record.op_share:
        sentence = (
            f"{where}: OP runs from {lo:.4g} to {hi:.4g}, a share of 1 or %; which values mean 0"
            " and 100 % is needed"
        )
        raise RecordError(sentence, "--op-span 0 1")
    if record.op_percent is None:
        # the range of the record is not that of the valve, and is never proposed
        counts = next((span for top, span in _COUNTS if hi <= top and lo >= 0), "")
        cure = f"if it is counts of a converter, add --op-span {counts}"
        unknown = "which values mean 0 and 100 % of travel is not known (--op-span LO HI states it)"
        return [f"{runs}, which is no %: S and J are in OP units; {cure if counts else unknown}"]
    other = "in mA, sizes are 6.25 times as large: add --op-span 4 20"
    if lo < hi <= _SHARE_OVER:
        other = "a share of 1, sizes are 100 times as large: add --op-span 0 1"
    elif not _CURRENT[0] <= lo < hi <= _CURRENT[1]:
        return []
    return [f"{runs}, taken as %; if it is {other}"]


def is_head(cells: Sequence[str], chosen: Mapping[str, str]) -> bool:
    """Whether some cells are the header of a record: PV and OP by name or choice, or time, tag and
    value.
    """
    names = [c.strip() for c in cells]
    named = {parse(n).role for n in names} | {r for r, name in chosen.items() if name in names}
    timed = len(names) > 2 and any(map(is_time, names))
    return {"pv", "op"} <= named or (timed and bool({"pv", "op"} & named)) or is_long(names)


def take_rows(sheet: Sheet, chosen: Mapping[str, str]) -> None:
    """Take rows off a table that are no samples: below it such as sum it up, and such as repeat the
    one above.
    """
    if not _is_text(sheet):
        return
    columns = list(sheet.columns.values())
    cells = sheet.columns.get(_time_name(sheet, chosen), [])
    first = max(len(cells) - _SUMMARY, 0)
    samples = [i for i in range(first, len(cells)) if re.search(r"\d", str(cells[i]))]
    end = samples[-1] + 1 if samples else len(cells)
    again = {i for i in range(1, end) if cells[i] == cells[i - 1] and cells[i]}
    # where stamps are coarse, samples may be alike
    if end - len(again) < 3 or any(c[i] != c[i - 1] for i in again for c in columns):
        again = set()
    if end < len(cells):
        below = ", ".join(map(str, cells[end:]))
        sheet.notes.append(f"file: {len(cells) - end} lines below the samples left out: {below}")
    if again:
        sheet.notes.append(f"time: {len(again)} rows that repeat the one above left out")
    if again or end < len(cells):
        kept = [i for i in range(end) if i not in again]
        rest = sheet.part({name: name for name in sheet.columns}, kept)
        sheet.columns = rest.columns
        sheet.lines = rest.lines


def take_units(sheet: Sheet, chosen: Mapping[str, str]) -> dict[str, str]:
    """Take units and descriptions out of a table, in rows below its head or after every number, and
    return the units of its columns.
    """
    units = {name: unit(name) for name in sheet.columns}
    if not _is_text(sheet):
        return units  # columns of numbers have no room for texts
    time = _time_name(sheet, chosen)
    for _ in range(3):
        first = {n: str(c[0]).strip() for n, c in sheet.columns.items() if c}
        cells = [c for n, c in first.items() if n != time and c]
        if (
            not cells
            or any(_numeric(c) or _state(c) for c in cells)
            or re.search(r"\d", first.get(time, ""))
        ):
            break
        units |= {n: c.strip("[]() ").lower() for n, c in first.items() if c}
        for column in sheet.columns.values():
            del column[0]  # pyright: ignore[reportIndexIssue]
        said = ", ".join(filter(None, first.values()))
        sheet.notes.append(f"file: {sheet.place(0)} taken as units or descriptions: {said}")
        del sheet.lines[:1]
    for name, column in sheet.columns.items():  # 12,3 m3/h
        written = _WITH_UNIT.fullmatch(str(column[0]).strip()) if len(column) else None
        if name == time or not written or not _numeric(written[1]) or plain(written[2]) in _MARKS:
            continue
        mark = written[2]
        cells = [str(c).strip() for c in column]
        if len(mark) == 1 and mark.isalpha():
            if any(c[-1:].isdigit() for c in cells):
                continue  # a unit stands after every number
            sheet.notes.append(f"unit: {mark!r} after each value of {name} is taken as its unit")
        sheet.columns[name] = [c.removesuffix(mark).rstrip() for c in cells]
        units[name] = units.get(name) or mark.lower()
    return units


def drop_quality(sheet: Sheet, chosen: Mapping[str, str], where: str) -> None:
    """Leave out the columns of quality that say the same of every sample, or of which the caller
    says so; refuse others, as which samples to keep is for the caller to decide.
    """
    given = chosen.get(QUALITY_OF, "")
    if given and given.lower() != NONE:
        raise RecordError(f"{where}: quality={given}; quality=none, which reads none, is allowed")
    for name in [n for n in sheet.columns if n not in chosen.values()]:
        # by its name, or by its words alone, of which the first is read before all
        cells = sheet.columns[name]
        is_named = is_quality(name)
        if not is_named and not (len(cells) > 0 and plain(str(cells[0])) in _MARKS):
            continue
        said = sorted({plain(str(c)) for c in cells if c is not None and c == c} - {""})
        if not is_named and not _MARKS.issuperset(said):
            continue

        # what it says of the samples; other words may be states of anything
        known = {found[0] for found in map(_QUALITY.match, said) if found}
        if not given and known and (len(said) > 1 or known & _BAD):
            which = f"column {_title(name)} says {' and '.join(map(repr, said[:2]))} of samples"
            needed = "the bad ones left empty are needed, which pandas makes by mask"
            raise RecordError(f"{where}: {which}; {needed}", "--columns quality=none")
        sheet.notes.append(f"quality: column {_title(name)} counts for nothing")
        del sheet.columns[name]


def _title(name: str) -> str:
    """Return the name of a column for a message."""
    return f"{int(name[1:]) + 1} without a name" if name.startswith(BLANK) else repr(name)


def _is_text(sheet: Sheet) -> bool:
    return all(isinstance(cells, list) for cells in sheet.columns.values())


def _time_name(sheet: Sheet, chosen: Mapping[str, str]) -> str:
    """Return the column of time, by its name or by the stamps that it holds."""
    stamped = (n for n, cells in sheet.columns.items() if is_stamped(cells))
    return chosen.get("t") or next(filter(is_time, sheet.columns), "") or next(stamped, "")


def read_numbers(sheet: Sheet, names: Sequence[str], where: str) -> dict[str, np.ndarray]:
    """Return columns as numbers; states such as "Bad" count as missing, with a note."""
    quick = _plain_numbers(sheet, names)
    if quick is not None:
        return quick
    out: dict[str, np.ndarray] = {}
    texts: dict[str, list[str]] = {}
    for name in names:
        cells = sheet.columns[name]
        if _is_numeric(cells):
            out[name] = np.array(cells, dtype=np.float64)
            continue
        texts[name] = [*map(_bare, cells)]
        _refuse_thousands(texts[name], name, where)
    comma = _decimal_comma([t for column in texts.values() for t in column if t], sheet, where)
    for name, column in texts.items():
        values = [_value(t, comma, i, name, sheet, where) for i, t in enumerate(column)]
        states = Counter(t for t, x in zip(column, values) if x != x and t and _state(t))
        out[name] = np.array(values, dtype=np.float64)
        sheet.notes += [
            f"status: {k} cells of {name} say {state!r} and count as missing"
            for state, k in states.items()
        ]
    for name, x in out.items():
        infinite = np.flatnonzero(np.isinf(x))
        if infinite.size:
            row = int(infinite[0])
            raise RecordError(
                f"{where}, {sheet.place(row)}: {name} is infinite ({_cell(sheet, name, row)});"
                f" {_NEEDED}"
            )
        out[name] = _without_sentinels(x, name, sheet)
    return out


def _plain_numbers(sheet: Sheet, names: Sequence[str]) -> dict[str, np.ndarray] | None:
    """Return columns of finite numbers with a point that nothing else can be; None where they need
    a closer look.
    """
    out = {}
    for name in names:
        cells = sheet.columns[name]
        if _is_numeric(cells):
            return None
        try:
            x = np.array(cells, dtype=np.float64)
            if "_" in "".join(cells):  # which Python reads as nothing, and no plant writes
                return None
        except (TypeError, ValueError):
            return None
        marked = next((c for c in cells if "." in c), None)
        if not np.isfinite(x).all() or (
            marked is not None and all(_GROUPS.fullmatch(c) for c in cells if "." in c)
        ):
            return None
        out[name] = _without_sentinels(x, name, sheet)
    return out


def is_long(names: Sequence[str]) -> bool:
    """Whether columns are those of a long table: time, tag and value."""
    low = {words_of(n): n for n in names}
    time, tag, value = (
        next((low[w] for w in words(what) if w in low), None) for what in ("time", "tag", "value")
    )
    if time is None:
        time = next((n for n in names if ends_with(n, words("time")) is not None), None)
    return len({time, tag, value} - {None}) == 3


def _bare(value: object) -> str:
    """Return a cell without separators of thousands."""
    text = "" if value is None else str(value).strip()
    if not text.isascii():
        text = text.replace("\u2212", "-")  # the minus sign of some languages
    apart = not text.isascii() or "'" in text or " " in text
    return _APART.sub("", text) if apart and text[:1] in "+-0123456789" else text


def _is_numeric(column: object) -> bool:
    return isinstance(column, np.ndarray) and column.dtype.kind in "fiub"


def _numeric(text: str) -> bool:
    bare = _bare(text)
    return any(c.isdigit() for c in bare) and bool(_POINT.fullmatch(bare) or _COMMA.fullmatch(bare))


def _state(text: str) -> bool:
    low = text.lower().strip("*<> ")
    return low in _NO_VALUE or low.startswith(("[-11059]", "bad "))


def _decimal_comma(texts: Sequence[str], sheet: Sheet, where: str) -> bool:
    """Decide whether the comma is the decimal sign, by every number of the table together."""
    if not any("," in t and _numeric(t) for t in texts):
        return False
    signed = [t for t in texts if ("," in t or "." in t) and _numeric(t)]
    point, comma = (all(rule.fullmatch(t) for t in signed) for rule in (_POINT, _COMMA))
    if point and comma:
        if sheet.delimiter == ";" and not any("." in t for t in signed):
            return True  # such files exist because the comma is taken
        example = next(t for t in signed if "," in t)
        raise RecordError(
            f"{where}: {example!r} may be {example.replace(',', '.')} or"
            f" {example.replace(',', '')}; write points"
        )
    if not point and not comma:
        one, other = (next(t for t in signed if not rule.fullmatch(t)) for rule in (_POINT, _COMMA))
        raise RecordError(
            f"{where}: {one!r} has a decimal comma, {other!r} a decimal point; one of them is"
            " needed"
        )
    if point:
        sheet.notes.append("numbers: commas separate thousands")
    return not point


def _refuse_thousands(column: Sequence[str], name: str, where: str) -> None:
    """Refuse 987 in one column with 1.012, which a program that separates thousands writes for
    1012.
    """
    marked = [t for t in column if "," in t or "." in t]
    # the first number decides most columns
    if any(not _GROUPS.fullmatch(t) and _numeric(t) for t in marked):
        return
    plain = [abs(float(t)) for t in column if len(t) < 5 and re.fullmatch(r"[+-]?[1-9]\d\d", t)]
    signed = [t for t in marked if _numeric(t)] if plain else []
    if signed:
        read = [abs(float(t.replace(",", "."))) for t in signed if len(re.findall("[.,]", t)) == 1]
        # 514.503 next to 515 has a decimal point: as 514503 it would be another signal
        if read and min(read) > 0.1 * min(plain):
            return
        raise RecordError(
            f"{where}: {name} holds {signed[0]!r} beside whole numbers; it may be"
            f" {re.sub('[.,]', '', signed[0])}"
        )


def _cell(sheet: Sheet, name: str, row: int) -> str:
    return str(sheet.columns[name][row]).strip()[:60]


def _value(text: str, comma: bool, row: int, name: str, sheet: Sheet, where: str) -> float:
    try:
        if "_" in text:  # which Python reads as nothing, and no plant writes in a number
            raise ValueError
        if comma:
            return (
                float(text.replace(".", "").replace(",", "."))
                if "," in text or _COMMA.fullmatch(text)
                else float(text)
            )
        return float(text.replace(",", ""))
    except ValueError:
        if not text or _state(text):
            return np.nan
        raise RecordError(f"{where}, {sheet.place(row)}: {name} is {text!r}; {_NEEDED}") from None


def _without_sentinels(x: np.ndarray, name: str, sheet: Sheet) -> np.ndarray:
    """Count as missing the numbers far from all others that historians write for no data."""
    known = x[np.isfinite(x)]
    for sentinel in _SENTINELS:
        rest = known[known != sentinel]
        if (
            rest.size > 2
            and rest.size < known.size
            and np.abs(rest - sentinel).min() > 10.0 * max(np.ptp(rest), 1.0)
        ):
            sheet.notes.append(
                f"status: {known.size - rest.size} cells of {name} hold {sentinel:g} and count as"
                " missing"
            )
            return np.where(x == sentinel, np.nan, x)
    return x
