"""Which column is what: names of signals, units, quality and tags, as historians and control systems write them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from detectors.errors import RecordError, nearest

SIGNALS = ("sp", "op", "pv", "mv")
TIME_NAMES = ("t_s", "t", "time", "timestamp", "datetime", "date time", "date", "time stamp")
# other words for a signal, as the last words of a column's name; CV and MV mean different things in different plants
SIGNAL_WORDS = {
    "pv": ("pv", "meas", "measurement", "process value", "process variable"),
    "op": ("op", "out", "output", "co"),
    "sp": ("sp", "spt", "sv", "setpoint", "set point"),
    "mv": ("mv", "valve position"),
}
QUALITY = ("quality", "status", "qual", "validity")
TAG_COLUMNS = ("tag", "tagname", "tag name", "point", "point name", "variable", "name")
VALUES = ("value", "val")
_VALUE_SUFFIX = ("cv", "value", "val")  # of a control system's parameter: FIC101/PID1/PV.CV
_PHRASES = {w for among in (*SIGNAL_WORDS.values(), TIME_NAMES, TAG_COLUMNS) for w in among if " " in w}


def find_roles(names: Sequence[str], chosen: Mapping[str, str], where: str, loop: str | None = None) -> dict[str, str]:
    """Return which column plays which role.

    Examples
    --------
    >>> find_roles(["Time", "FIC101.MEAS", "FIC101.OUT (%)"], {}, "a.csv")
    {'t': 'Time', 'op': 'FIC101.OUT (%)', 'pv': 'FIC101.MEAS'}
    """
    roles = {}
    for role, name in chosen.items():
        role = "t" if role in TIME_NAMES else role
        if role not in ("t", *SIGNALS):
            raise RecordError(f"{where}: column mapping for {role!r}; {nearest(role, ('t', *SIGNALS))}")
        if name not in names:
            raise RecordError(f"{where}: no column {name!r} for {role}, {nearest(name, names)}")
        if name in roles.values():
            raise RecordError(f"{where}: column {name!r} is named for two roles; each needs a column of its own")
        roles[role] = name
    mine = [n for n in names if loop is None or words(loop) == words(n)[: len(words(loop))]]
    if loop is not None and not mine:
        raise RecordError(f"{where}: no column of loop {loop!r}; columns are: {shown(names)}")
    for role in ("t", *SIGNALS):
        among = names if role == "t" else mine
        found = _candidates(among, TIME_NAMES if role == "t" else SIGNAL_WORDS[role], role)
        if role in roles or not found:
            continue
        if len(found) > 1:
            what = "the time" if role == "t" else role.upper()
            raise RecordError(f"{where}: {' or '.join(found)} may be {what}; name the loop, or the columns")
        roles[role] = found[0]
    if "t" in roles and "t" not in chosen:
        _one_time(names, roles["t"], where)
    return {role: roles[role] for role in ("t", *SIGNALS) if role in roles}


def column_pairs(texts: Sequence[str] | None) -> dict[str, str] | None:
    """Return what a command line says of columns.

    Examples
    --------
    >>> column_pairs(["op=OUT,pv=MEAS", "t=clock"])
    {'op': 'OUT', 'pv': 'MEAS', 't': 'clock'}
    """
    pairs = {}
    for text in (part.strip() for word in texts or [] for part in word.split(",")):
        role, equals, name = text.partition("=")
        if not (role and equals and name):
            raise RecordError(f"--columns {text!r}: ROLE=NAME is needed, like op=FIC101.OUT")
        if role.strip() in pairs:
            raise RecordError(f"--columns {text!r}: {role.strip()} is {pairs[role.strip()]!r} already; one is allowed")
        pairs[role.strip()] = name.strip()
    return pairs or None


def _one_time(names: Sequence[str], time: str, where: str) -> None:
    """Refuse a table in which signals have times of their own, such as Timestamp, PV, Timestamp.1, OP."""
    exact = {str(n) for n in names if str(n).strip().lower() in TIME_NAMES}
    others = [n for n in names if n not in exact and n != time and re.match(r"(date|time)", str(n).strip().lower())]
    others = [n for n in others if ends_with(n, QUALITY) is None]
    if others:
        raise RecordError(f"{where}: {time!r} and {others[0]!r} may both be times; say which (columns t=NAME), or export one")


def words(name: str) -> list[str]:
    """Return a name as its words in small letters, without unit and value suffix."""
    bare = re.sub(r"\s*[\[(].*$", "", str(name).strip().lower())
    parts = [p for p in re.split(r"[./:\\ ]+", bare) if p]
    pieces = [p for p in re.split(r"[_\-]+", parts[-1]) if p] if parts else []
    # FIC101_PV is PV of a tag, PV_Quality a signal's, set_point one word in two; n_pv is something else
    tagged = any(c.isdigit() for p in [*parts[:-1], *pieces[:-1]] for c in p)
    if tagged or " ".join(pieces) in _PHRASES or (pieces and pieces[-1] in (*QUALITY, *_VALUE_SUFFIX)):
        parts = [*parts[:-1], *pieces]
    return parts[:-1] if len(parts) > 1 and parts[-1] in _VALUE_SUFFIX else parts


def unit(name: str) -> str:
    """Return what stands in brackets at the end of a name, or behind the last underscore of a time."""
    found = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$", str(name))
    if found:
        return found.group(1).lower()
    tail = re.fullmatch(r"(?:t|time|timestamp|elapsed)_([a-z]+)", str(name).strip().lower())
    return tail.group(1) if tail and tail.group(1) != "stamp" else ""


def shown(names: Sequence[str]) -> str:
    """Return the first names of many, for a message."""
    return ", ".join(str(name)[:60] for name in names[:12]) + (", ..." if len(names) > 12 else "")


def ends_with(name: str, among: Sequence[str]) -> list[str] | None:
    """Return the words of a name before one of some endings, or None without one."""
    parts = words(name)
    for ending in (e.split() for e in among):
        if parts[-len(ending) :] == ending:
            return parts[: -len(ending)]
    return None


def _candidates(names: Sequence[str], among: Sequence[str], role: str) -> list[str]:
    """Return the columns that may play a role: of the exact name, else of the role's own word, else of another word."""
    exact = [n for w in among for n in names if str(n).strip().lower() == w]
    if exact and (role == "t" or str(exact[0]).strip().lower() == role):
        return exact[:1]
    if role == "t":
        return [n for n in names if _unit_time(n) or ends_with(n, among) is not None]
    return [n for n in names if ends_with(n, among[:1]) is not None] or [n for n in names if ends_with(n, among) is not None]


def _unit_time(name: str) -> bool:
    """Whether a name is a time with its unit behind an underscore, like t_min."""
    return bool(re.fullmatch(r"(?:t|time)_[a-z]+", str(name).strip().lower()))
