"""Choose the columns of every loop of a table by their names, and read cells as numbers and modes.

To read the names of another system, add its words to `_NAMES`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from shlex import quote
from typing import NamedTuple

import numpy as np

from simbench.detectors.errors import RecordError, nearest, printable
from simbench.detectors.records.files import Cells, Sheet

SIGNALS = ("sp", "op", "pv", "mv")
MODE = "mode"
MANUAL = "MAN"
SHORTEST = 3  # samples of a record
NONE = "none"  # in place of a column that is not to be read
_QUALITY = "quality"
_ROLES = ("t",) + SIGNALS + (MODE, _QUALITY)
# small letters, spaces between the words; a row has a time, may name its loop, and a quality
_NAMES = {
    "t": "time, timestamp, time stamp, t stamp, datetime, date time, date and time, date, elapsed,"
    " last changed",
    "tag": "tag, tag name, tagname, point, point name, name, loop, loop tag, loop name, entity id",
    "value": "value, val, state",
    _QUALITY: "quality, quality code, qc, status, validity, confidence, good, bad",
    "pv": "pv, process value, process variable, measured value, measurement, meas, pv in",
    "op": "op, out, output, co, controller output, control output, lmn",
    "sp": "sp, setpoint, set point, spt, sv",
    "mv": "mv, valve position, valve pos, position, pos, travel, valve travel, stem position",
    MODE: "mode, controller mode",
}
_ROLE_OF = {word: role for role, words in _NAMES.items() for word in words.split(", ")}
TIME_UNITS = {
    **{"ms": 1e-3, "msec": 1e-3, "milliseconds": 1e-3, "s": 1.0, "sec": 1.0, "second": 1.0},
    **{"seconds": 1.0, "min": 60.0, "minute": 60.0, "minutes": 60.0, "h": 3600.0, "hr": 3600.0},
    **{"hour": 3600.0, "hours": 3600.0, "d": 86400.0, "day": 86400.0, "days": 86400.0},
}


def _any_of(*roles: str) -> str:
    words = sorted((word for word, role in _ROLE_OF.items() if role in roles), key=len)
    return "|".join(words[::-1])


_TIME = re.compile(
    rf"(?:t|time|timestamp|elapsed)(?: (?P<unit>{'|'.join(TIME_UNITS)}))?"
    rf"|(?:.* )?(?:{_any_of('t')})"
)
_OF_ROW = re.compile(rf"(?P<word>{_any_of('tag', 'value')})|(?:.* )?(?:{_any_of(_QUALITY)})")
# the tag of a loop, the signal, what a system adds (FIC101/PID1/PV.CV), the unit
_SIGNAL = re.compile(
    rf"(?:(?P<loop>.+?) )??(?P<word>{_any_of(*SIGNALS, MODE)})"
    r"(?: (?:f|cv|value|val|actual|current|raw|avg|mean|last|average))*"
    r"(?: (?P<unit>pct|percent|%|k?pa|barg?|mbar|psig?|degc|degf|m3 ?h|kg ?h|mm|ma|v|volt|c|m))?"
)
# a transmitter or indicator of a position, by the letters of ISA-5.1: ZT1010, ZI-1010, ZIT1010A
_POSITION = re.compile(r"(?:.* )?z(?:t|i|it) ?\d+[a-z]?(?: pv)?")
LAYOUT = "a row per time with a column each for OP and PV is needed, which pandas makes by"

_MODES = {
    "AUTO": "auto, aut, a, automatic, true, on, lsp, local, closed, 1, 8",
    MANUAL: "man, m, manual, hand, false, off, iman, init, lo, oos, rout, trk, track, open, 0, 16",
    "CAS": "cas, c, casc, cascade, rcas, bcas, rsp, remote, 2, 3, 4",
}
_MODE_OF = {word: mode for mode, words in _MODES.items() for word in words.split(", ")}
# written in place of a number that is not known
_NO_VALUE = {
    *("", "bad", "no data", "nan", "null", "none", "n/a", "#n/a", "na", "-", "--", "---", "?"),
    *("bad input", "i/o timeout", "comm fail", "calc failed", "pt created", "scan off", "error"),
}
_SENTINELS = (-99999.0, -9999.0, -999.25, -999.0, 9999.0, 99999.0)  # the same, as numbers
_COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")  # may be, or have three decimals
_STAMP = re.compile(r"\d{1,4}[-/.]\w{1,9}[-/.]\d{2,4}|\d:\d\d")

Roles = dict[str, str]  # the column of each signal


class Name(NamedTuple):
    """A column's name taken apart: the signal, the words of its loop, the word for it, the unit."""

    role: str = ""
    loop: tuple[str, ...] = ()
    word: str = ""
    unit: str = ""


@lru_cache(4096)
def parse(name: str) -> Name:
    """Take the name of a column apart."""
    # the words, and a unit in brackets
    text = words_of(name)
    bracket = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$", name)
    if bracket:
        unit = bracket[1].lower()
    else:
        unit = ""

    # what a row is about
    if found := _TIME.fullmatch(text):
        return Name("t", unit=unit or found["unit"] or "")
    if found := _OF_ROW.fullmatch(text):
        return Name(_ROLE_OF.get(found["word"], _QUALITY))

    # a signal of a loop, or a column of something else
    if _POSITION.fullmatch(text):  # what it measures is the valve's, not the process's
        return Name("mv", tuple(text.split()))
    if found := _SIGNAL.fullmatch(text):
        loop = tuple((found["loop"] or "").split())
        unit = unit or (found["unit"] or "").replace(" ", "")
        return Name(_ROLE_OF[found["word"]], loop, found["word"], unit)
    return Name(loop=tuple(text.split()), unit=unit)


@lru_cache(4096)
def words_of(name: str) -> str:
    """Return the words of a name in small letters with spaces between, without such in brackets."""
    rest = re.sub(r"[\[(][^\])]*[\])]?", " ", name)
    rest = re.sub(r"(?<=[a-z]{2})(?=[A-Z][a-z])", " ", rest)  # SetPoint
    return " ".join(re.findall(r"[^\W_]+|%", rest.casefold()))


def is_head(cells: Sequence[str], chosen: Mapping[str, str]) -> bool:
    """Return whether cells are the header of a record: OP and PV, by their names or as the caller
    names them, or one of them, or a tag and a value, beside a time.
    """
    roles = {parse(cell).role for cell in cells} | {r for r, n in chosen.items() if n in cells}
    timed = "t" in roles and ({"op", "pv"} & roles or {"tag", "value"} <= roles)
    return len(cells) > 1 and bool({"op", "pv"} <= roles or timed)


def take_samples(table: Sheet, chosen: Mapping[str, str]) -> None:
    """Join dates with clock times, and leave out what is said of the quality of samples; refuse a
    layout without a row per time and a column per signal.
    """
    # the tag of every value in a column of its own, or a time before each signal
    roles = {}
    for name in table.columns:
        roles[name] = parse(name).role
    among = {*roles.values(), *chosen}
    if {"t", "tag", "value"} <= among and not {"pv", "op"} <= among:
        raise RecordError(f"{table.where}: a row per time and tag; {LAYOUT} pivot_table")
    order = list(roles.values())
    if {"pv", "op"} <= {role for before, role in pairwise(order) if before == "t"}:
        raise RecordError(f"{table.where}: signals with times of their own; {LAYOUT} merge_asof")

    # a date and a clock time in two columns
    words = {}
    for name in roles:
        words[words_of(name)] = name
    dates = table.columns.get(words.get("date", ""))
    clocks = table.columns.get(words.get("time", ""))
    if isinstance(dates, list) and isinstance(clocks, list):
        both = [d if d == c else f"{d} {c}" for d, c in zip(dates, clocks, strict=True)]
        table.columns[words["time"]] = both
        del table.columns[words["date"]]

    # what is said of the quality of samples is for the caller to decide
    for name, cells in list(table.columns.items()):
        by_name = parse(name).role == _QUALITY
        if name in chosen.values() or not (by_name or isinstance(cells, list)):
            continue
        said = {str(cell)[:20].strip().lower() for cell in cells} - {"", "nan", "none"}
        if not by_name and not {"good", "bad"} <= said:
            continue
        if len(said) > 1 and chosen.get(_QUALITY, "").lower() != NONE:
            which = f"column {name!r} says {' and '.join(map(repr, sorted(said)[:2]))} of samples"
            needed = "the bad ones left empty are needed, which pandas makes by mask"
            raise RecordError(f"{table.where}: {which}; {needed}", "--columns quality=none")
        table.notes.append(f"quality: column {name!r} counts for nothing")
        del table.columns[name]


def split_by_tag(table: Sheet) -> dict[str, Sheet]:
    """Take a table apart by the loop that every row names; itself under "" where none does."""
    names = {}
    for name in table.columns:
        names[parse(name).role] = name
    if "tag" not in names or not {"op", "pv"} <= names.keys() or parse(names["op"]).loop:
        return {"": table}
    tags = np.array([str(cell).strip() for cell in table.columns.pop(names["tag"])])
    counts = Counter(tags.tolist())
    if len(counts) < 2 or min(counts.values()) < SHORTEST:  # remarks, and no tags
        return {"": table}
    return {tag: _take_rows(table, np.flatnonzero(tags == tag)) for tag in counts}


def _take_rows(table: Sheet, rows: np.ndarray) -> Sheet:
    columns = {
        name: cells[rows] if isinstance(cells, np.ndarray) else [cells[k] for k in rows]
        for name, cells in table.columns.items()
    }
    if len(table.lines):
        lines = np.asarray(table.lines)[rows]
    else:
        lines = ()
    return replace(table, columns=columns, lines=lines, notes=list(table.notes), found={})


def find_loops(table: Sheet, chosen: Mapping[str, str]) -> dict[str, Roles]:
    """Return the loops of a table by tag, or "", with the column of each signal."""
    # the columns that the caller names, and the others by loop
    given = _check_chosen(table, chosen)
    groups: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for name in table.columns:
        role, loop, *_ = parse(name)
        if role in (SIGNALS + (MODE,)) and name not in given.values():
            groups.setdefault(loop, {}).setdefault(role, []).append(name)

    # several loops, each with both signals
    whole = [loop for loop, among in groups.items() if {"op", "pv"} <= among.keys()]
    if len(whole) > 1 and not {"op", "pv"} & given.keys():
        return {_tag_of(k, groups[k]["pv"][0]): _pick_each(table, groups[k], {}) for k in whole}

    # one: its own columns, then such as name no loop, or a tag of the same number
    if "pv" in given:
        loop = parse(given["pv"]).loop
    else:
        loop = next(iter(whole), ())
    mine = groups.get(loop, {})
    more: dict[str, list[str]] = {}
    for other, among in groups.items():
        if not loop or not other or _number_of_tag(other) == _number_of_tag(loop) != "":
            for role in among.keys() - mine.keys():
                more[role] = more.get(role, []) + among[role]
    roles = _pick_each(table, more | mine, given)
    if "pv" not in given:
        one = parse(roles.get("pv", "")).loop
    else:
        one = ()
    if "op" not in given:
        two = parse(roles.get("op", "")).loop
    else:
        two = ()
    if one and two and one != two and _number_of_tag(one) != _number_of_tag(two):
        both = f"{table.where}: {roles['pv']} and {roles['op']} name two loops"
        raise RecordError(
            f"{both}; which is PV and which OP is needed", _columns_option(roles, "pv", "op")
        )
    return {_tag_of(one, roles["pv"]) if one else "": roles}


def _check_chosen(table: Sheet, chosen: Mapping[str, str]) -> Roles:
    """Return the columns that the caller names, checked."""
    given: Roles = {}
    for role, name in chosen.items():
        # a role that there is, and that is to be read
        if role not in _ROLES:
            raise RecordError(f"{table.where}: no column is a {role!r}, {nearest(role, _ROLES)}")
        if name.lower() == NONE and role not in ("t", "op", "pv"):
            continue

        # a column of its own
        if name not in table.columns or role == _QUALITY:
            if role == _QUALITY:
                known = "none"
            else:
                known = nearest(name, table.columns)
            raise RecordError(f"{table.where}: no column {name!r} for {role}, {known}")
        if name in given.values():
            twice = f"{table.where}: column {name!r} is named for two roles"
            raise RecordError(f"{twice}; each needs a column of its own")
        given[role] = name
    return given


def _pick_each(table: Sheet, among: Mapping[str, list[str]], given: Roles) -> Roles:
    """Return one column for each signal of a loop: of the standard name, else the only one."""
    roles = {}
    for role, name in given.items():
        if role != "t":
            roles[role] = name
    for role in (r for r in SIGNALS + (MODE,) if r in among and r not in given):
        names = [n for n in among[role] if words_of(n) == role] or among[role]
        names = [n for n in names if parse(n).word == role] or names
        if len(names) > 1:
            which = f"{table.where}: {' or '.join(names)} may be {role.upper()}; one is needed"
            raise RecordError(which, _columns_option({role: names[0]}, role))
        roles[role] = names[0]
    return roles


def refuse_missing(table: Sheet, roles: Roles) -> None:
    """Refuse a loop without OP or PV, with a command that names columns for them: such as move,
    and do not rise from row to row, as clocks do.
    """
    missing = [role for role in ("pv", "op") if role not in roles]
    if not missing:
        return

    # such columns
    if missing == ["op"] and parse(roles.get("mv", "")).word == "mv":
        free = [roles["mv"]]
    else:
        free = []
    times = []
    for name in table.columns:
        if parse(name).role == "t":
            times.append(name)
    for name, cells in table.columns.items():
        if isinstance(cells, list):  # whatever the decimal sign
            cells = [str(cell).replace(",", ".") for cell in cells]
        x = _as_floats(cells)
        x = x[np.isfinite(x)]
        if _always_rises(x) or name in times:
            times.append(name)
        elif x.size and np.ptp(x) > 0 and name not in roles.values():
            free.append(name)
    shown = ", ".join(list(table.columns)[:12])
    lacks = f"{table.where}: no {missing[0].upper()} column; columns are: {shown}"
    if len(free) < len(missing):
        raise RecordError(f"{lacks}; {LAYOUT} merge of several files")

    # as they may be meant
    if times:
        likely = {"t": times[0]}
    else:
        likely = {}
    likely |= dict(zip(missing, free, strict=False))
    raise RecordError(lacks, _columns_option(likely, *likely))


def _columns_option(roles: Roles, *named: str) -> str:
    return "--columns " + quote(",".join(f"{role}={roles[role]}" for role in named))


def find_time(table: Sheet, chosen: Mapping[str, str], roles: Roles) -> str:
    """Return the column of time, by its name or by the stamps that it holds."""
    # by name, of the whole table before one of a signal
    if "t" in chosen:
        return chosen["t"]
    times = []
    for name in _shows_time(table, "name"):
        if name not in roles.values():
            times.append(name)
    times = [name for name in times if words_of(name).startswith("t")] or times
    if len(times) > 1:
        which = f"{table.where}: {' or '.join(times)} may be the time; one is needed"
        raise RecordError(which, _columns_option({"t": times[0]}, "t"))

    # by what it holds
    stamped = _shows_time(table, "stamp")
    stamped = times or [name for name in stamped if name not in roles.values()]
    if stamped:
        if not times:
            table.notes += [f"time: {stamped[0]!r} holds time stamps"]
        return stamped[0]

    # A counter, which may be the time
    clocks = _shows_time(table, "order")
    if clocks:
        cure = _columns_option({"t": clocks[0]}, "t")
    else:
        cure = "--ts 1"
    lacks = f"{table.where}: no time column (t, time, timestamp) and no sampling period Ts given"
    if clocks and clocks[0] in roles.values():
        cure = ""
        lacks = f"{lacks}; {clocks[0]!r} is given as a signal, and rises as time does"
    raise RecordError(f"{lacks}; either is needed", cure)


def _shows_time(table: Sheet, clue: str) -> list[str]:
    """Return the columns that may be the time by their name, by the stamp in their first cell or by
    the order of their numbers, looked for once for all loops of a table.
    """
    if clue not in table.found:
        holds = {
            "name": lambda name, _: parse(name).role == "t",
            "stamp": lambda _, cells: _STAMP.search(str(cells[0])),
            "order": lambda _, cells: _always_rises(_as_floats(cells)),
        }[clue]
        table.found[clue] = [name for name, cells in table.columns.items() if holds(name, cells)]
    return table.found[clue]


def _always_rises(x: np.ndarray) -> bool:
    return x.size > 1 and bool(np.all(x[1:] > x[:-1]))


def _tag_of(loop: Sequence[str], name: str) -> str:
    """Return the tag of a loop as a column writes it."""
    if loop:
        at = name.casefold().rfind(loop[-1])
    else:
        at = -1
    if at >= 0:
        return name[: at + len(loop[-1])]
    return " ".join(loop)


def _number_of_tag(loop: Iterable[str]) -> str:
    """Return the number of a tag: of the last word that has one."""
    digits = [re.sub(r"\D", "", word) for word in loop]
    return next(filter(None, digits[::-1]), "")


def choose_loop(tag: str, labels: Iterable[str]) -> list[str]:
    """Return the loops of exactly a tag, else those whose path ends with it, else holds it."""
    asked = f" {words_of(tag)} "
    among = {}
    for label in labels:
        among[label] = f" {words_of(label)} "
    same = [label for label in among if label == tag]
    ending = [label for label, words in among.items() if words.endswith(asked)]
    holding = [label for label, words in among.items() if asked in words]
    return same or ending or holding


def read_numbers(table: Sheet, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Return columns as numbers, NaN where they are empty, or say "Bad" or the like."""
    # by all of them together the comma is the decimal sign, or separates thousands
    columns = {name: table.columns[name] for name in names}
    texts = []
    for cells in columns.values():
        if isinstance(cells, list):
            for c in cells:
                texts.append(c)
    commas = []
    for text in texts:
        if _COMMA.fullmatch(str(text).strip()):
            commas.append(str(text))
    if commas and table.delimiter != ";" and all(map(_THOUSANDS.fullmatch, commas)):
        two = f"{commas[0].replace(',', '.')} or {commas[0].replace(',', '')}"
        raise RecordError(f"{table.where}: {commas[0]!r} may be {two}; write points")
    read = {}
    for name, cells in columns.items():
        x = _as_floats(cells, bool(commas))
        if commas and isinstance(cells, np.ndarray) and np.any(x % 1 > 0):
            mixed = f"{commas[0]!r} has a decimal comma, {name} a decimal point"
            raise RecordError(f"{table.where}: {mixed}; one of them is needed")
        read[name] = _without_states(table, name, x)
    return read


def _without_states(table: Sheet, name: str, x: np.ndarray) -> np.ndarray:
    """Return a column with NaN for all that says that there is no number; other text is refused."""
    # words
    cells = table.columns[name]
    states: Counter[str] = Counter()
    for row in np.flatnonzero(~np.isfinite(x)):
        text = str(cells[row]).strip()
        if text.lower().strip("*<> ") not in _NO_VALUE:
            what = f"{table.where}, {table.place(row)}: {name} is {text[:60]!r}"
            raise RecordError(f"{what}; a number, or nothing for unknown, is needed")
        states[text] += text not in ("", "nan", "None")
    for state, count in (+states).items():
        table.notes.append(f"status: {count} cells of {name} say {state!r} and count as missing")

    # a number far from all others
    known = x[np.isfinite(x)]
    for sentinel in _SENTINELS:
        rest = known[known != sentinel]
        if 2 < rest.size < known.size and np.abs(rest - sentinel).min() > 10 * max(np.ptp(rest), 1):
            count = f"status: {known.size - rest.size} cells of {name} hold {sentinel:g}"
            table.notes.append(f"{count} and count as missing")
            return np.where(x == sentinel, np.nan, x)
    return x


def _as_floats(cells: Cells, comma: bool = False) -> np.ndarray:
    """Return cells as numbers, NaN where they are none."""
    if isinstance(cells, list):
        return np.array([as_float(cell, comma) for cell in cells], dtype=np.float64)
    if cells.dtype.kind in "fiu":
        return np.asarray(cells, float)
    return np.full(len(cells), np.nan)


def as_float(cell: object, comma: bool = False) -> float:
    """Return a cell as a number, NaN where it is none."""
    if isinstance(cell, float):
        return cell
    text = str(cell)
    # Python reads 1_000, which no plant writes
    if "_" in text or (comma and "." in text):
        return np.nan
    try:
        return float(text.replace(",", ".") if comma else text)
    except ValueError:
        return np.nan


def read_modes(table: Sheet, name: str) -> np.ndarray | None:
    """Return the mode of every sample, held until the next; None where no word is understood."""
    # the mode that each word or number means; "AUTO-INIT" and "P-AUTO" mean automatic
    cells = table.columns[name]
    said = [f"{c:g}" if isinstance(c, float) else str(c or "").strip() for c in cells]
    modes = {}
    for text in set(said):
        words = (text.lower(), *re.findall(r"[^-.\s]+", text.lower()))
        modes[text] = next((_MODE_OF[word] for word in words if word in _MODE_OF), "")
    known = [k for k, text in enumerate(said) if modes[text]]
    if not known:
        table.notes.append(f"mode: {name!r} is not understood and counts for nothing")
        return None

    # a historian stores a mode when it changes
    odd = Counter(text for text in said if not modes[text] and text not in ("", "nan"))
    for text, count in odd.most_common(1):
        other = f"samples say {printable(text)!r}, which is no mode known here"
        table.notes.append(f"mode: {count} {other}; the mode before them is taken to last")
    before = np.searchsorted(known, np.arange(len(said)), side="right") - 1
    return np.array([modes[said[k]] for k in known])[np.maximum(before, 0)]
