"""Find out which column of a table is which signal, from the names that historians and control
systems use for signals, units, quality and tags.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from functools import lru_cache
from shlex import quote

from simbench.detectors.errors import RecordError, nearest


def entries(table: str) -> tuple[str, ...]:
    """Return the entries of a table of words, which commas separate."""
    return tuple(" ".join(table.split()).split(", "))


SIGNALS = ("sp", "op", "pv", "mv")
MODE, QUALITY_OF = "mode", "quality"
_ROLES = ("t", *SIGNALS, MODE)
ASKED = "NAME"  # used in a hint for the column that the user alone can name
TIME_NAMES = entries("""
    t s, t, time, timestamp, ts, datetime, date time, date, time stamp, t stamp, time string,
    date and time, elapsed, elapsed time, zeitstempel, zeit, zeitpunkt, datum, datum uhrzeit,
    uhrzeit, datum zeit, horodatage, date heure, heure, temps, marca de tiempo, fecha hora,
    fecha y hora, fecha, hora, tiempo, ora, 时间戳, 时间, 日期时间, 日期
""")
DATES, CLOCKS = (
    entries("date, datum, fecha, 日期"),
    entries("time, uhrzeit, zeit, heure, hora, ora, 时间"),
)
# words for a signal, its standard name first; CV and MV mean different things in different plants.
# Accents are left out
SIGNAL_WORDS = {
    "pv": entries("""
        pv, meas, measurement, measured value, process value, process variable, pv in, istwert, ist,
        regelgrosse, regelgroesse, mesure, valeur mesuree, medida, medicion, valor medido,
        valor de proceso, variable de proceso, misura, 测量值, 测量, 过程值, 过程变量, 实际值,
        被控变量
    """),
    "op": entries("""
        op, out, output, co, controller output, control output, lmn, stellgrosse, stellgroesse,
        stellwert, stellsignal, reglerausgang, ausgang, sortie, sortie regulateur, commande, salida,
        salida del controlador, salida controlador, uscita, 输出, 输出值, 控制器输出, 控制输出,
        阀位指令, 阀门开度指令
    """),
    "sp": entries("""
        sp, spt, sv, setpoint, set point, setpt, sollwert, soll, fuhrungsgrosse, fuehrungsgroesse,
        consigne, consigna, punto de consigna, 设定值, 设定, 给定值, 给定
    """),
    "mv": entries("""
        mv, valve position, position, pos, valve pos, travel, valve travel, stem position,
        ventilstellung, stellungsruckmeldung, ruckmeldung, rueckmeldung, position vanne,
        posicion valvula, posicion de valvula, 阀位反馈, 阀位,
        阀门开度
    """),
    MODE: entries("mode, controller mode, modus, betriebsart, modo, 模式"),
}
QUALITY = entries("""
    quality, opcquality, opc quality, quality detail, quality code, data quality, status, qual, qc,
    validity, qstatus, qlevel, confidence, good, bad, qualitat, qualitaet, qualite, calidad,
    qualita, 质量, 状态
""")
TAG_COLUMNS = entries("""
    tag, tagname, tag name, point, point name, pointname, variable, name, varname, var name,
    item id, itemid, item, object, tag path, path, series, metric, node id, nodeid, measurement,
    data source, messstelle, repere, etiqueta, nombre, 标签, 标签名, 位号, 点名
""")
PARAMETER_COLUMNS = entries("""
    field, parameter, attribute, property, signal, merkmal, parametre, parametro, 参数
""")
VALUES = entries("value, val, var value, varvalue, wert, messwert, valeur, valor, 值, 数值")
# after a signal's name: FIC101/PID1/PV.CV, FIC101.PV.Value, MODE.ACTUAL
_VALUE_SUFFIX = entries("cv, value, val, f, actual, current, raw, avg, mean, last, average, wert")
_UNITS = entries("""
    pct, percent, prozent, %, kpa, mpa, hpa, pa, bar, barg, mbar, psi, psig, degc, degf, m3h, m3hr,
    kgh, kghr, nm3h, lpm, gpm, lmin, mm, cm, ma, v, volt, counts, cnt, ppm, rpm, celsius, hz, mmhg,
    scfm, kgs, tph, th, c, m
""")
_DIN = {"w": "sp", "x": "pv", "y": "op"}  # after a tag, as DIN 19226 calls them: TIC5.X
# a transmitter or indicator of a position, by the letters of ISA-5.1: ZT1010, ZI-1010, ZIT1010A; ZC
# is a controller, ZS a switch
_POSITION = re.compile(r"(^|\s)z(t|i|it) ?\d+[a-z]?(\s|$)")
_SAME_UNIT = {"pct": "%", "percent": "%", "prozent": "%", "cnt": "counts", "raw": "counts"}
_APART = re.compile(r"(?:[^\w%]|_)+")
# what may stand before the name of what is measured: Consigne débit; an output or a position may be
# the process's
_FIRST = entries("""
    setpoint, sollwert, istwert, stellgrosse, stellgroesse, stellwert, mesure, consigne, sortie,
    commande, medida, medicion, consigna, salida, misura, uscita
""")


@dataclass(frozen=True)
class Name:
    """A column's name taken apart: the words of its loop, the signal, and how surely it is that
    one.
    """

    loop: tuple[str, ...]
    role: str | None
    unit: str
    rank: int  # 0 the signal's standard name, 1 another word for it
    loose: bool  # joined by an underscore to a word without a digit: n_pv may be something else


@lru_cache(4096, typed=True)
def plain(text: object) -> str:
    """Return a text in small letters without accents."""
    bare = unicodedata.normalize("NFKD", str(text).strip())
    return "".join(c for c in bare if not unicodedata.combining(c)).casefold()


@lru_cache(4096)
def parse(name: str) -> Name:
    """Take the name of a column apart."""
    parts, unit_of = _parts(name), _bracket(name)
    if not unit_of and len(parts) > 1 and parts[-1] in _UNITS and _ending(parts[:-1])[0]:
        unit_of, parts = parts[-1], parts[:-1]
    elif len(parts) > 2 and "".join(parts[-2:]) in _UNITS and _ending(parts[:-2])[0]:
        unit_of, parts = "".join(parts[-2:]), parts[:-2]
    unit_of = _SAME_UNIT.get(unit_of, unit_of)
    role, size, rank = _ending(parts)
    if role in (None, "pv") and _POSITION.search(" ".join(parts)):
        # what a transmitter of the position measures is the valve's, not the process's
        return Name(tuple(parts[: len(parts) - size]), "mv", unit_of, 1, False)
    if role is not None:
        loop = parts[: len(parts) - size]
        loose = (
            bool(loop)
            and not any(c.isdigit() for w in loop for c in w)
            and bool(re.search(r"[_\-]\w+\W*$", str(name)))
        )
        return Name(tuple(loop), role, unit_of, rank, loose)
    if len(parts) > 1 and parts[-1] in _DIN and any(c.isdigit() for c in parts[-2]):
        return Name(tuple(parts[:-1]), _DIN[parts[-1]], unit_of, 1, False)
    for role, among in SIGNAL_WORDS.items():  # the signal may stand first: PV_FIC101
        for rank, phrase in enumerate(among):
            size = len(phrase.split())
            numbered = any(c.isdigit() for w in parts[size:] for c in w)
            if parts[:size] == phrase.split() and (
                numbered or (phrase in _FIRST and not is_time(name))
            ):
                if not numbered:
                    return Name((), role, unit_of, 2, False)
                return Name(tuple(parts[size:]), role, unit_of, min(rank, 1), False)
    return Name(tuple(parts), None, unit_of, 1, False)


def _parts(name: object) -> list[str]:
    """Return the words of a name, whatever separates them, without what follows in brackets
    them.
    """
    text = str(name).strip()
    lead = re.match(r"\[([^\]]*)\](?=.)", text)
    rest = re.sub(r"[\[(][^\])]*[\])]?", " ", text[lead.end() :] if lead else text)
    rest = re.sub(r"(?<=[a-zà-ÿ]{2})(?=[A-Z][a-z])", " ", rest)  # SetPoint
    parts = [p for p in _APART.split(plain(f"{lead[1]} {rest}" if lead else rest)) if p]
    if parts and parts[-1].endswith("%") and len(parts[-1]) > 1:
        parts[-1:] = [parts[-1][:-1], "%"]
    glued = re.fullmatch(r"(.*\d)(pv|op|sp|sv|mv|mode)", parts[-1]) if parts else None
    counted = (
        re.fullmatch(r"(pv|op|sp|sv|mv|out|mode)(\d{1,4})", parts[0]) if len(parts) == 1 else None
    )
    if glued:
        return [*parts[:-1], *glued.groups()]
    return [*reversed(counted.groups())] if counted else parts


def _ending(parts: Sequence[str]) -> tuple[str | None, int, int]:
    """Return which signal some words end with, in how many of them, and whether by its standard
    name (0) or another (1).
    """
    for cut in range(len(parts), 0, -1):
        best: tuple[str | None, int, int] = (None, 0, 1)
        for role, among in SIGNAL_WORDS.items():
            for rank, phrase in enumerate(among):
                words = phrase.split()
                if list(parts[max(cut - len(words), 0) : cut]) == words and len(words) > best[1]:
                    best = (role, len(words), min(rank, 1))
        if best[0]:
            return best[0], best[1] + len(parts) - cut, best[2]
        if parts[cut - 1] not in _VALUE_SUFFIX:
            break
    return None, 0, 1


def find_loops(
    names: Sequence[str], chosen: Mapping[str, str], where: str, tag: str | None = None
) -> dict[str, dict[str, str]]:
    """Return the loops that columns hold, by tag, each with the column of every signal."""
    fixed = _chosen(names, chosen, where)
    groups: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for name in names:
        parsed = parse(name)
        if parsed.role is not None and name not in fixed.values():
            groups.setdefault(parsed.loop, {}).setdefault(parsed.role, []).append(name)
    for loop, signals in groups.items():
        # MV with SV, and no OP, is the controller's output as Yokogawa names it; untagged it may
        # be a valve's position
        if (
            loop
            and "op" not in signals
            and len(signals.get("mv", [])) == 1
            and "mv" in _parts(signals["mv"][0])[-2:]
            and any("sv" in _parts(n)[-2:] for n in signals.get("sp", []))
        ):
            signals["op"] = signals.pop("mv")
    if {"pv", "op"} & set(fixed):
        return {"": _one(names, groups, fixed, where, tag)}
    whole = {loop: signals for loop, signals in groups.items() if {"pv", "op"} <= set(signals)}
    if len(whole) > 1:  # Mesure débit next to FIC101.PV is something else
        whole = {
            k: v for k, v in whole.items() if min(parse(n).rank for n in (*v["pv"], *v["op"])) < 2
        } or whole
    if tag is not None:
        whole = _tagged(whole, tag) or {}
        if len(whole) > 1:
            raise several_loops(
                {
                    _shown_tag(loop, signals): _picked(signals, {}, where)
                    for loop, signals in whole.items()
                },
                where,
            )
        if not whole:
            mine = [n for n in names if _within(_parts(tag), parse(n).loop)]
            if not mine:
                raise _no_loop(names, groups, tag, where)
            groups = {k: v for k, v in groups.items() if _within(_parts(tag), k)}
    if len(whole) > 1:
        sure = {
            loop: signals
            for loop, signals in whole.items()
            if not any(parse(n).loose for c in signals.values() for n in c)
        }
        whole = sure or whole
    if not whole:
        return {"": _one(names, groups, fixed, where, tag)}
    if len(whole) == 1:
        loop, signals = next(iter(whole.items()))
        return {_shown_tag(loop, signals): _one(names, groups, fixed, where, tag, loop)}
    return {
        _shown_tag(loop, signals): _picked(signals, fixed, where) for loop, signals in whole.items()
    }


def is_loop(name: str, tag: str) -> bool:
    """Whether a loop's name, which may be a path, holds the words of a tag."""
    return _within(_parts(tag), _parts(name))


def names_loops(names: Sequence[str]) -> bool:
    """Whether the column of any signal names the loop that it is of."""
    return any(parsed.loop for parsed in map(parse, names) if parsed.role is not None)


def _chosen(names: Sequence[str], chosen: Mapping[str, str], where: str) -> dict[str, str]:
    """Return the columns that the caller names, checked; the time and quality are others'
    business.
    """
    roles: dict[str, str] = {}
    for given, name in chosen.items():
        role = "t" if plain(given).replace("_", " ") in TIME_NAMES else given
        if role not in (*_ROLES, QUALITY_OF):
            raise RecordError(
                f"{where}: column mapping for {role!r}; {nearest(role, (*_ROLES, QUALITY_OF))}"
            )
        if role in ("t", QUALITY_OF):
            continue
        if name not in names:
            raise RecordError(f"{where}: no column {name!r} for {role}, {nearest(name, names)}")
        if name in roles.values():
            raise RecordError(
                f"{where}: column {name!r} is named for two roles; each needs a column of its own"
            )
        roles[role] = name
    return roles


def _picked(
    signals: Mapping[str, list[str]], fixed: Mapping[str, str], where: str
) -> dict[str, str]:
    """Return one column per signal of one loop: of the standard name, else of another."""
    roles = dict(fixed)
    for role in (*SIGNALS, MODE):
        among = signals.get(role, [])
        if role in roles or not among:
            continue
        exact = [n for n in among if plain(n) == role]
        best = exact[:1] or [n for n in among if parse(n).rank == min(parse(m).rank for m in among)]
        actual = [n for n in best if "actual" in plain(n)]
        if len(best) > 1 and role == MODE and len(actual) == 1:
            best = actual
        if len(best) > 1:
            sentence = f"{where}: {' or '.join(best)} may be {role.upper()}; one is needed"
            raise RecordError(sentence, _columns({role: ASKED}))
        roles[role] = best[0]
    return {role: roles[role] for role in (*SIGNALS, MODE) if role in roles}


def _one(
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
    mine = {
        role: [n for n in c if not parse(n).loose or loop]
        for role, c in groups.get(loop or (), {}).items()
    }
    digits = tag_number(loop or ())
    for role in (*SIGNALS, MODE):
        if mine.get(role):
            continue
        others = [
            n for signals in groups.values() for n in signals.get(role, []) if not parse(n).loose
        ]
        # FT101.PV, FV101.OUT and FIC101.SP are one loop; what names another number is another's
        if loop:
            others = [
                n
                for n in others
                if not parse(n).loop or (digits and tag_number(parse(n).loop) == digits)
            ]
        if others:
            mine[role] = others
    roles = _picked(mine, fixed, where)
    loops = {
        role: parse(roles[role]).loop
        for role in ("pv", "op")
        if role in roles and role not in fixed
    }
    if len(loops) == 2 and all(loops.values()) and tag is None and not _alike(*loops.values()):
        raise RecordError(
            f"{where}: {roles['pv']} and {roles['op']} name two loops; which is PV and which OP is"
            " needed",
            _columns(roles),
        )
    return roles


def find_time(names: Sequence[str], chosen: Mapping[str, str], where: str) -> str | None:
    """Return the column of time; None without one."""
    given = next((n for r, n in chosen.items() if plain(r).replace("_", " ") in TIME_NAMES), None)
    if given is not None:
        if given not in names:
            raise RecordError(f"{where}: no column {given!r} for t, {nearest(given, names)}")
        return given
    exact = [n for w in TIME_NAMES for n in names if plain(n).replace("_", " ") == w]
    if exact:
        first = exact[0]
        others = [
            n
            for n in names
            if n not in exact and re.match(r"(date|time)", plain(n)) and not is_quality(n)
        ]
        if others and not re.fullmatch(r"time_ms", plain(others[0])):
            sentence = f"{first!r} and {others[0]!r} may both be times; say which, or export one"
            raise RecordError(f"{where}: {sentence}", _columns({"t": ASKED}))
        return first
    candidates = [n for n in names if is_time(n)]
    if len(candidates) > 1:
        raise RecordError(
            f"{where}: {' or '.join(candidates)} may be the time; one is needed",
            _columns({"t": ASKED}),
        )
    return candidates[0] if candidates else None


def is_time(name: str) -> bool:
    """Whether a name is that of a time, with its unit after an underscore or a tag before it."""
    parts = _parts(name)
    ends = any(parts[-len(w.split()) :] == w.split() for w in TIME_NAMES if w not in ("t", "t s"))
    return (
        ends
        or parts in (["t"], ["t", "s"])
        or bool(re.fullmatch(r"(?:t|time)_[a-z]+", plain(name)))
    )


def is_quality(name: str) -> bool:
    """Whether a name is that of a quality."""
    return quality_of(name) is not None


def quality_of(name: str) -> list[str] | None:
    """Return the words of the signal whose quality a name is, or None; of several alike the
    later are numbered.
    """
    return ends_with(re.sub(r"\.\d+$", "", name), QUALITY)


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
    sentence = f"{where}: no {role.upper()} column"
    free = [n for n in names if n and n not in roles.values() and parse(n).role is None]
    free = [n for n in free if not is_time(n) and not is_quality(n)]
    if not any(re.search(r"[^\W\d]", n) for n in names):
        return RecordError(
            f"{where}: no header line, the first is {shown(names)}; the names of its columns are"
            " needed first"
        )
    if role == "op" and "mv" in roles and "mv" in _parts(roles["mv"]):
        sentence, free = (
            f"{sentence}; MV may be the controller's output: then say so",
            [roles["mv"]],
        )
    known = {r: n for r, n in roles.items() if r in ("pv", "op")}
    if len(free) > 1 - len(known):
        return RecordError(sentence, _columns({"op": ASKED, "pv": ASKED} | known))
    return RecordError(f"{sentence}; columns are: {shown(names)}")


def unit(name: str) -> str:
    """Return the unit in a name: in brackets at its end, after a signal, or after the last
    underscore of a time.
    """
    tail = re.fullmatch(r"(?:t|time|timestamp|elapsed)_([a-z]+)", plain(name))
    return parse(name).unit or (
        tail.group(1) if tail and tail.group(1) not in ("stamp", "string") else ""
    )


def shown(names: Sequence[str]) -> str:
    """Return the first names of many, for a message."""
    return ", ".join(str(name)[:60] for name in names[:12]) + (", ..." if len(names) > 12 else "")


def ends_with(name: str, among: Sequence[str]) -> list[str] | None:
    """Return the words of a name before one of some endings, or None without one."""
    parts = _parts(name)
    for ending in sorted((e.split() for e in among), key=len, reverse=True):
        if parts[-len(ending) :] == ending:
            return parts[: -len(ending)]
    return None


def _bracket(name: object) -> str:
    match = re.search(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$", str(name))
    return match.group(1).lower() if match else ""


def tag_number(words: Sequence[str]) -> str:
    """Return the number of a tag: of the last word that has one."""
    return next(
        (digits for w in reversed(words) if (digits := "".join(c for c in w if c.isdigit()))), ""
    )


def _alike(one: Sequence[str], other: Sequence[str]) -> bool:
    return tuple(one) == tuple(other) or (
        bool(tag_number(one)) and tag_number(one) == tag_number(other)
    )


def _within(words: Sequence[str], loop: Sequence[str]) -> bool:
    n = len(words)
    return any(list(loop[i : i + n]) == list(words) for i in range(len(loop) - n + 1))


def _tagged(
    whole: Mapping[tuple[str, ...], dict[str, list[str]]], tag: str
) -> dict[tuple[str, ...], dict[str, list[str]]]:
    words = _parts(tag)
    for fits in (
        lambda k: list(k) == words,
        lambda k: list(k[-len(words) :]) == words,
        lambda k: _within(words, k),
    ):
        matches = {k: v for k, v in whole.items() if fits(k)}
        if matches:
            return matches
    return {}


def several_loops(loops: Mapping[str, Mapping[str, str]], where: str) -> RecordError:
    """Return the refusal of a file with several loops where one record is needed."""
    ops = list(dict.fromkeys(roles["op"] for roles in loops.values()))
    sentence = f"{' or '.join(ops[:2])} may be OP: " if len(ops) > 1 else ""
    sentence += f"{len(loops)} loops, {shown(list(loops))}; the tag of one is needed"
    return RecordError(f"{where}: {sentence}", f"--tag {quote(next(iter(loops)))}")


def _no_loop(names: Sequence[str], groups: Mapping, tag: str, where: str) -> RecordError:
    whole = [
        _shown_tag(loop, signals)
        for loop, signals in groups.items()
        if loop and {"pv", "op"} <= set(signals)
    ]
    sentence = f"{where}: no column of loop {tag!r}; columns are: {shown(names)}"
    if not whole:
        return RecordError(sentence)
    close = max(
        whole,
        key=lambda name: SequenceMatcher(None, " ".join(_parts(name)[-1:]), plain(tag)).ratio(),
    )
    return RecordError(sentence, f"--tag {quote(close)}")


def _shown_tag(loop: Sequence[str], signals: Mapping[str, list[str]]) -> str:
    """Return the tag of a loop as its columns write it."""
    name = signals["pv"][0]
    lower, last = name.casefold(), (loop[-1] if loop else "")
    at = lower.rfind(last)
    return (
        name[: at + len(last)].strip(" _-.")
        if last and at >= 0 and len(lower) == len(name)
        else " ".join(loop)
    )


def _columns(roles: Mapping[str, str]) -> str:
    return "--columns " + quote(",".join(f"{role}={name}" for role, name in roles.items()))
