"""Find out which column of a table is which signal of which loop, by the words of `dialects`."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, lru_cache
from shlex import quote

from simbench.detectors.errors import RecordError, nearest
from simbench.detectors.records.dialects import words

SIGNALS = ("sp", "op", "pv", "mv")
MODE = "mode"
QUALITY_OF = "quality"
NONE = "none"  # in place of a column that is not to be read
_OPTIONAL = ("sp", "mv", MODE)
_ROLES = ("t", *SIGNALS, MODE)
ASKED = "NAME"  # used in a hint for the column that the user alone can name
# ends the refusal of another layout, before the name of the function
LAYOUT = "a row per time with a column each for OP and PV is needed, which pandas makes by"
_ROLE_OF = {word: role for role in (*SIGNALS, MODE) for word in words(role)}


@cache
def _any_of(among: tuple[str, ...]) -> str:
    """Return a pattern of some words, the longest first."""
    return "|".join(map(re.escape, sorted(among, key=len, reverse=True)))


# what a system writes after a signal's name: FIC101/PID1/PV.CV, FIC101.PV.Value, MODE.ACTUAL
_SUFFIX = "cv|value|val|f|actual|current|raw|avg|mean|last|average|wert"
_UNIT = (
    "pct|percent|prozent|%|k?pa|mpa|hpa|barg?|mbar|psig?|degc|degf|n?m3 ?hr?|kg ?hr?|kg ?s|l ?min|"
    "lpm|gpm|mm|cm|ma|v|volt|counts|cnt|ppm|rpm|celsius|hz|mmhg|scfm|t ?ph|t ?h|c|m"
)
_WORD = rf"(?P<word>{_any_of((*_ROLE_OF,))})"
_LOOP_FIRST = re.compile(rf"(?:(?P<loop>.+?) )??{_WORD}(?: (?:{_SUFFIX}))*(?: (?P<unit>{_UNIT}))?")
_SIGNAL_FIRST = re.compile(rf"{_WORD} (?P<loop>.*\d.*)(?P<unit>)")  # PV_FIC101
_SAME_UNIT = {"pct": "%", "percent": "%", "prozent": "%", "cnt": "counts", "raw": "counts"}
_WHOLE_TIMES = tuple(word for word in words("time") if word not in ("t", "t s"))
_TIME = re.compile(rf"(?:.* )?(?:{_any_of(_WHOLE_TIMES)})")
_TIME_UNIT = re.compile(r"(?:t|time|timestamp|elapsed)_(?!stamp|string)([a-z]+)")
# a transmitter or indicator of a position, by the letters of ISA-5.1: ZT1010, ZI-1010, ZIT1010A; ZC
# is a controller, ZS a switch
_POSITION = re.compile(r"(^|\s)z(t|i|it) ?\d+[a-z]?(\s|$)")


@dataclass(frozen=True)
class Name:
    """A column's name taken apart: the words of its loop, the signal, the word for it, the unit."""

    loop: tuple[str, ...]
    role: str | None
    word: str
    unit: str


@lru_cache(4096, typed=True)
def plain(text: object) -> str:
    """Return a text in small letters without accents."""
    bare = unicodedata.normalize("NFKD", str(text).strip())
    return "".join(c for c in bare if not unicodedata.combining(c)).casefold()


@lru_cache(4096)
def parse(name: str) -> Name:
    """Take the name of a column apart."""
    bracket = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$", name)
    text = words_of(name)
    found = _LOOP_FIRST.fullmatch(text) or _SIGNAL_FIRST.fullmatch(text)
    loop = tuple((found["loop"] or "").split()) if found else (*text.split(),)
    role, word = (_ROLE_OF[found["word"]], found["word"]) if found else (None, "")
    unit_of = bracket[1].lower() if bracket else ((found and found["unit"]) or "").replace(" ", "")
    if role in (None, "pv") and _POSITION.search(text):
        # what a transmitter of the position measures is the valve's, not the process's
        role = "mv"
        word = ""
    return Name(loop, role, word, _SAME_UNIT.get(unit_of, unit_of))


def words_of(name: object) -> str:
    """Return the words of a name with spaces between, whatever separates them, without what stands
    in brackets.
    """
    text = str(name).strip()
    lead = re.match(r"\[([^\]]*)\](?=.)", text)  # of a server: [default]Unit1/FIC101/PV
    rest = re.sub(r"[\[(][^\])]*[\])]?", " ", text[lead.end() :] if lead else text)
    rest = re.sub(r"(?<=[a-zà-ÿ]{2})(?=[A-Z][a-z])", " ", rest)  # SetPoint
    whole = plain(f"{lead[1]} {rest}" if lead else rest)
    whole = re.sub(r"(?<=\d)(?=(?:pv|op|sp|sv|mv|mode)$)", " ", whole)  # FIC101PV
    return " ".join(re.findall(r"[^\W_]+|%", whole))


def find_loops(
    names: Sequence[str], chosen: Mapping[str, str], where: str, tag: str | None = None
) -> dict[str, dict[str, str]]:
    """Return the loops that columns hold, by tag, each with the column of every signal."""
    fixed = _columns_named(names, chosen, where)
    groups: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for name in names:
        parsed = parse(name)
        if parsed.role is not None and name not in fixed.values():
            groups.setdefault(parsed.loop, {}).setdefault(parsed.role, []).append(name)
    for loop, signals in groups.items():
        # MV beside SV, and no OP, is the controller's output as Yokogawa names it; untagged it may
        # be a valve's position
        said = {r: [parse(n).word for n in signals.get(r, [])] for r in ("mv", "sp")}
        if loop and "op" not in signals and said["mv"] == ["mv"] and "sv" in said["sp"]:
            signals["op"] = signals.pop("mv")
    if {"pv", "op"} & set(fixed):
        return {"": _columns_of_one(names, groups, fixed, where, tag)}
    whole = {loop: signals for loop, signals in groups.items() if {"pv", "op"} <= set(signals)}
    if tag is not None:
        whole = _loops_of_tag(whole, tag)
        if not whole:
            asked = words_of(tag).split()
            if not any(_is_within(asked, parse(n).loop) for n in names):
                raise _no_loop(names, groups, tag, where)
            groups = {loop: signals for loop, signals in groups.items() if _is_within(asked, loop)}
    if len(whole) > 1:
        loops = {_tag_of(k, v): _pick_columns(v, {}, where) for k, v in whole.items()}
        if tag is not None:
            raise several_loops(loops, where)
        return loops
    loop, signals = next(iter(whole.items()), (None, {}))
    named = _tag_of(loop, signals) if loop else ""
    return {named: _columns_of_one(names, groups, fixed, where, tag, loop)}


def is_loop(name: str, tag: str) -> bool:
    """Whether a loop's name, which may be a path, holds the words of a tag."""
    return _is_within(words_of(tag).split(), words_of(name).split())


def names_loops(names: Sequence[str]) -> bool:
    """Whether the column of any signal names the loop that it is of."""
    return any(parsed.loop for parsed in map(parse, names) if parsed.role is not None)


def _columns_named(names: Sequence[str], chosen: Mapping[str, str], where: str) -> dict[str, str]:
    """Return the columns that the caller names, checked; the time and quality are others'
    business.
    """
    roles: dict[str, str] = {}
    for given, name in chosen.items():
        role = "t" if words_of(given) in words("time") else given
        if role not in (*_ROLES, QUALITY_OF):
            raise RecordError(
                f"{where}: column mapping for {role!r}; {nearest(role, (*_ROLES, QUALITY_OF))}"
            )
        if role in ("t", QUALITY_OF) or (role in _OPTIONAL and name.lower() == NONE):
            continue
        if name not in names:
            raise RecordError(f"{where}: no column {name!r} for {role}, {nearest(name, names)}")
        if name in roles.values():
            raise RecordError(
                f"{where}: column {name!r} is named for two roles; each needs a column of its own"
            )
        roles[role] = name
    return roles


def _pick_columns(
    signals: Mapping[str, list[str]], fixed: Mapping[str, str], where: str
) -> dict[str, str]:
    """Return one column per signal of one loop: of the standard name, else of another."""
    roles = dict(fixed)
    for role, among in signals.items():
        if role in roles:
            continue
        best = (
            [n for n in among if plain(n) == role]
            or [n for n in among if parse(n).word == role]
            or among
        )
        if len(best) > 1:
            sentence = f"{where}: {' or '.join(best)} may be {role.upper()}; one is needed"
            raise RecordError(sentence, _columns({role: ASKED}))
        roles[role] = best[0]
    return {role: roles[role] for role in (*SIGNALS, MODE) if role in roles}


def _columns_of_one(
    names: Sequence[str],
    groups: Mapping[tuple[str, ...], dict[str, list[str]]],
    fixed: dict[str, str],
    where: str,
    tag: str | None,
    loop: tuple[str, ...] | None = None,
) -> dict[str, str]:
    """Return the signals of the only loop: its columns, then such as name no other loop."""
    if loop is None and "pv" in fixed:
        loop = parse(fixed["pv"]).loop
    mine = {**groups.get(loop or (), {})}
    for role in (*SIGNALS, MODE):
        others = [n for signals in groups.values() for n in signals.get(role, [])]
        if loop:
            # FT101.PV, FV101.OUT and FIC101.SP are one loop; another number is another's
            others = [n for n in others if not parse(n).loop or _same_tag(parse(n).loop, loop)]
        if others and role not in mine:
            mine[role] = others
    roles = _pick_columns(mine, fixed, where)
    loops = {r: parse(roles[r]).loop for r in ("pv", "op") if r in roles and r not in fixed}
    if len(loops) == 2 and all(loops.values()) and tag is None and not _same_tag(*loops.values()):
        raise RecordError(
            f"{where}: {roles['pv']} and {roles['op']} name two loops; which is PV and which OP is"
            " needed",
            _columns(roles),
        )
    return roles


def find_time(names: Sequence[str], chosen: Mapping[str, str], where: str) -> str | None:
    """Return the column of time; None without one."""
    given = next((n for r, n in chosen.items() if words_of(r) in words("time")), None)
    if given is not None and given not in names:
        raise RecordError(f"{where}: no column {given!r} for t, {nearest(given, names)}")
    exact = [n for w in words("time") for n in names if words_of(n) == w]
    among = [given] if given is not None else exact[:1] or [n for n in names if is_time(n)]
    if len(among) > 1:
        sentence = f"{where}: {' or '.join(among)} may be the time; one is needed"
        raise RecordError(sentence, _columns({"t": ASKED}))
    return among[0] if among else None


def is_time(name: str) -> bool:
    """Whether a name is that of a time, with its unit after an underscore or a tag before it."""
    text = words_of(name)
    return bool(text in ("t", "t s") or _TIME.fullmatch(text) or _TIME_UNIT.fullmatch(plain(name)))


def is_quality(name: str) -> bool:
    """Whether a name is that of a quality; of several alike the later are numbered."""
    return ends_with(re.sub(r"\.\d+$", "", name), words("quality")) is not None


def column_pairs(texts: Sequence[str] | None) -> dict[str, str] | None:
    """Return the columns that a command line names."""
    pairs = {}
    for text in (
        part.strip() for word in texts or [] for part in re.split(r",(?=\s*\w+\s*=)", word)
    ):
        role, equals, name = text.partition("=")
        if not (role and equals and name):
            raise RecordError(f"--columns {text!r}: ROLE=NAME is needed, like op=FIC101.OUT")
        if role.strip() in pairs:
            raise RecordError(
                f"--columns {text!r}: {role.strip()} is {pairs[role.strip()]!r} already; one is"
                " allowed"
            )
        pairs[role.strip()] = name.strip()
    return pairs or None


def no_column(role: str, roles: Mapping[str, str], names: Sequence[str], where: str) -> RecordError:
    """Return the refusal of a table without a signal, with the form of the option that names it
    where a column is free.
    """
    if not any(re.search(r"[^\W\d]", n) for n in names):
        return RecordError(
            f"{where}: no header line, the first is {shown(names)}; the names of its columns are"
            " needed first"
        )
    sentence = f"{where}: no {role.upper()} column"
    free = [n for n in names if n not in roles.values() and parse(n).role is None]
    free = [n for n in free if not is_time(n) and not is_quality(n)]
    if role == "op" and "mv" in roles and parse(roles["mv"]).word == "mv":
        sentence += "; MV may be the controller's output: then say so"
        free = [roles["mv"]]
    known = {r: n for r, n in roles.items() if r in ("pv", "op")}
    if len(free) > 1 - len(known):
        return RecordError(sentence, _columns({"op": ASKED, "pv": ASKED} | known))
    return RecordError(f"{sentence}; columns are: {shown(names)}; {LAYOUT} merge of several files")


def unit(name: str) -> str:
    """Return the unit in a name: in brackets at its end, after a signal, or after the last
    underscore of a time.
    """
    time = _TIME_UNIT.fullmatch(plain(name))
    return time[1] if time else parse(name).unit


def shown(names: Sequence[str], width: int = 60) -> str:
    """Return the first names of many, for a message."""
    return ", ".join(name[:width] for name in names[:12]) + (", ..." if len(names) > 12 else "")


def ends_with(name: str, among: tuple[str, ...]) -> list[str] | None:
    """Return the words of a name before one of some endings, or None without one."""
    found = re.fullmatch(rf"(?:(.*?) )??(?:{_any_of(among)})", words_of(name))
    return (found[1] or "").split() if found else None


def _tag_number(loop: Sequence[str]) -> str:
    """Return the number of a tag: of the last word that has one."""
    return next((d for w in reversed(loop) if (d := "".join(filter(str.isdigit, w)))), "")


def _same_tag(one: Sequence[str], other: Sequence[str]) -> bool:
    return tuple(one) == tuple(other) or "" != _tag_number(one) == _tag_number(other)


def _is_within(tag: Sequence[str], loop: Sequence[str]) -> bool:
    return f" {' '.join(tag)} " in f" {' '.join(loop)} "


def _loops_of_tag(
    whole: Mapping[tuple[str, ...], dict[str, list[str]]], tag: str
) -> dict[tuple[str, ...], dict[str, list[str]]]:
    """Return the loops of exactly a tag, else those whose path ends with it, else holds it."""
    asked = tuple(words_of(tag).split())
    for fits in (
        lambda loop: loop == asked,
        lambda loop: loop[-len(asked) :] == asked,
        lambda loop: _is_within(asked, loop),
    ):
        if matches := {loop: signals for loop, signals in whole.items() if fits(loop)}:
            return matches
    return {}


def several_loops(loops: Mapping[str, Mapping[str, str]], where: str) -> RecordError:
    """Return the refusal of a file with several loops where one record is needed."""
    ops = list(dict.fromkeys(roles["op"] for roles in loops.values()))
    sentence = f"{' or '.join(ops[:2])} may be OP: " if len(ops) > 1 else ""
    sentence += f"{len(loops)} loops, {shown(list(loops))}; the tag of one is needed"
    return RecordError(f"{where}: {sentence}", f"--tag {quote(next(iter(loops)))}")


def _no_loop(names: Sequence[str], groups: Mapping, tag: str, where: str) -> RecordError:
    whole = [_tag_of(k, v) for k, v in groups.items() if k and {"pv", "op"} <= set(v)]
    sentence = f"{where}: no column of loop {tag!r}; columns are: {shown(names)}"
    if not whole:
        return RecordError(sentence, "" if groups else _columns({"op": ASKED, "pv": ASKED}))
    close = {name.casefold(): name for name in whole}
    (best,) = get_close_matches(tag.casefold(), close, 1, 0.0)
    return RecordError(sentence, f"--tag {quote(close[best])}")


def _tag_of(loop: Sequence[str], signals: Mapping[str, list[str]]) -> str:
    """Return the tag of a loop as its columns write it."""
    name = signals["pv"][0]
    last = loop[-1] if loop else ""
    at = name.casefold().rfind(last)
    return name[: at + len(last)].strip(" _-.") if last and at >= 0 else " ".join(loop)


def _columns(roles: Mapping[str, str]) -> str:
    return "--columns " + quote(",".join(f"{role}={name}" for role, name in roles.items()))
