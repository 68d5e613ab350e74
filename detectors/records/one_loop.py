"""One loop of an opened table as a `LoopRecord`, with a note on all that was done to it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from shlex import quote
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, RecordError, nearest, printable
from simbench.detectors.record import MOST_OUTSIDE, LoopRecord
from simbench.detectors.records.clock import CALENDAR, is_stamped, seconds
from simbench.detectors.records.dialects import words
from simbench.detectors.records.gaps import (
    HELD_VALUES,
    SHORTEST,
    STRAIGHT_LINES,
    fill_gaps,
    known_samples,
    last_known,
    resample,
)
from simbench.detectors.records.historian import op_span, open_span, read_numbers
from simbench.detectors.records.mode import AUTO, CAS, MAN, mode
from simbench.detectors.records.opened import OpenedTable, with_ranges
from simbench.detectors.records.roles import (
    LAYOUT,
    MODE,
    SIGNALS,
    find_time,
    no_column,
    parse,
    unit,
)
from simbench.detectors.records.tables import BLANK, example_of_columns, rises
from simbench.detectors.signal.holds import runs_of

# first letter of a controller's tag, as in FIC101, LC-4, 12PIC10201 or TICA7: what it measures
_KIND_OF = {
    "F": "flow",
    "L": "level",
    "P": "pressure",
    "T": "temperature",
    "A": "analyser",
}
_LETTERS = re.compile(r"(?<![A-Za-z])([FLPTA])I?C[A-Z]?[ _-]?\d", re.ASCII)
# sampling periods (s) at which nobody records a loop for its control, by what it controls: a
# historian's minute, doubled, for fast loops, a quarter of an hour for any
_SLOWEST = {"flow": 120.0, "pressure": 120.0}
_SLOWEST_OF_ANY = 900.0


@dataclass(frozen=True)
class _EvenSignals:
    """Signals on an even grid: the time of the first sample (s), the sampling period (s), the
    signals by role, and notes on what was bridged or left out.
    """

    begins: float
    Ts: float
    signals: dict[str, np.ndarray]
    notes: list[str]


def make_record(
    table: OpenedTable, roles: dict[str, str], chosen: Mapping[str, str], about: dict[str, Any]
) -> LoopRecord:
    """Return the record of one loop of a table, with the notes on all that was done to it."""
    sheet = table.sheet
    where = table.where
    automatic = about.pop("automatic", True)
    Ts = about.pop("Ts", None)
    how = about.pop("resample", None)
    _refuse_options(Ts, how, where)
    _refuse_missing_signal(table, roles)
    other = [(r, n) for r, n in roles.items() if r not in (MODE, *chosen)]
    sheet.notes += [f"columns: {r.upper()} is {n!r}" for r, n in other if parse(n).word != r]
    recorded, signals, modes, given = _read_signals(table, roles, chosen, Ts, how)
    if recorded.size < SHORTEST:
        raise RecordError(f"{where}: {recorded.size} samples; at least {SHORTEST} are needed")
    named = table.units.get(roles["op"]) or unit(roles["op"])
    span = op_span(named, about.get("op_span"), signals["op"], where, sheet.notes)
    if span is not None:
        about["op_span"] = span
    held = None if modes is None else _mode_held(modes, roles[MODE], sheet.notes)
    meta: dict[str, Any] = {}
    t = recorded
    if held is not None and automatic:
        t, signals, meta["automatic"] = _automatic(t, signals, held, sheet.notes)
    even = _put_on_even_grid(t, signals, given, where)
    notes = [*sheet.notes, *even.notes]
    if t[0] > CALENDAR:  # events are shared by records of the same time only
        meta["start"] = even.begins
    if given is None and even.Ts >= _SLOWEST.get(str(about.get("kind")), _SLOWEST_OF_ANY):
        notes.append(_odd_pace(even.Ts))
    if about.get("kind") is None:
        notes += _kind_by_tag(str(about.get("tag", "")))
    if not automatic:
        meta = {**_rows_of(recorded, held, even), **meta}
    about["meta"] = {**meta, **about.get("meta", {})}
    record = LoopRecord(Ts=even.Ts, notes=tuple(notes), **even.signals, **about)
    notes += [*open_span(record, where), *_check_span(record, where)]
    return replace(record, notes=tuple(notes))


def _unknown_modes(cells: Sequence[object] | np.ndarray, modes: np.ndarray) -> list[str]:
    """Return a note on the words that are no mode, if some are: the mode before them is held."""
    said = ("" if c is None or c != c else str(c).strip() for c in cells)
    odd = Counter(text for text, known in zip(said, modes, strict=True) if text and not known)
    if not odd or not (modes != "").any():
        return []
    (word, _), *_ = odd.most_common(1)
    return [
        f"mode: {odd.total()} samples say {printable(word)!r}, which is no mode known here; the"
        " mode before them is taken to last"
    ]


def _read_signals(
    table: OpenedTable,
    roles: dict[str, str],
    chosen: Mapping[str, str],
    Ts: float | None,
    how: str | None = None,
):
    """Read the columns of a loop: times, signals (NaN where unknown), modes, and the
    sampling period where it is given; `how` its samples are put on an even grid, if they are.
    """
    # the signals, some samples of which must have OP and PV
    sheet = table.sheet
    where = table.where
    read = read_numbers(sheet, [roles[s] for s in SIGNALS if s in roles], where)
    signals = {s: read[roles[s]] for s in SIGNALS if s in roles}
    n = signals["pv"].size
    if n < SHORTEST:
        raise RecordError(f"{where}: {n} samples; at least {SHORTEST} are needed")
    known = {role: np.isfinite(signals[role]) for role in ("op", "pv")}
    for role, here in known.items():
        if not here.any():
            raise RecordError(
                f"{where}: {roles[role]!r} holds no number, which {role.upper()} needs"
            )
    if not np.any(known["op"] & known["pv"]):
        raise RecordError(f"{where}: no row has both OP and PV; {LAYOUT} groupby(TIME).first()")

    # the mode of the controller
    modes = None
    if MODE in roles:
        cells = sheet.columns[roles[MODE]]
        modes = mode(cells)
        sheet.notes += _unknown_modes(cells, modes)

    # the time: counted, in the column of its name, or in one of stamps
    if Ts is not None and how is None:
        return np.arange(n) * float(Ts), signals, modes, Ts
    name = find_time(list(sheet.columns), chosen, where)
    if name is None:
        free = {n: cells for n, cells in sheet.columns.items() if n not in roles.values()}
        name = next((n for n, cells in free.items() if is_stamped(cells)), None)
        sheet.notes += [] if name is None else [f"time: {name!r} holds time stamps"]
    if name is None:
        names = ", ".join(words("time")[:6])
        sentence = (
            f"{where}: no time column ({names}) and no sampling period Ts given; either is needed"
        )
        clocks = [n for n, cells in sheet.columns.items() if rises(cells)]
        signal = {n: role.upper() for role, n in roles.items()}
        if clocks and clocks[0] in signal:
            wrong = (
                f"{clocks[0]!r}, given as {signal[clocks[0]]}, rises from row to row as time does"
            )
            raise RecordError(f"{sentence}; {wrong}")
        raise RecordError(sentence, f"--columns t={quote(clocks[0])}" if clocks else "--ts 1")
    t = seconds(
        sheet.columns[name],
        name,
        where,
        unit=table.units.get(name, ""),
        place=sheet.place,
        notes=sheet.notes,
        again=how is not None,
        signals=signals,
    )
    if t[0] > t[-1]:
        t = t[::-1]
        signals = {role: x[::-1] for role, x in signals.items()}
        modes = None if modes is None else modes[::-1]
    if how is None:
        return t, signals, modes, None

    # on an even grid
    series = {role: known_samples(t, x) for role, x in signals.items()}
    for role in ("op", "pv"):
        if series[role][0].size < SHORTEST:
            few = f"{series[role][0].size} samples of {role.upper()}"
            raise RecordError(f"{where}: {few}; at least {SHORTEST} are needed")
    there = {role: one for role, one in series.items() if one[0].size}
    times, signals, Ts, note = resample(there, Ts, how)
    sheet.notes.append(note)
    modes = modes if modes is None else last_known(times, t, modes, "")
    return times, signals, modes, Ts


def _refuse_options(Ts: float | None, how: str | None, where: str) -> None:
    """Refuse a sampling period or a way of resampling that does not exist."""
    known = (HELD_VALUES, STRAIGHT_LINES)
    if how is not None and how not in known:
        raise ParameterError(f"resample {how!r}: {nearest(str(how), known)}")
    if Ts is not None and not 0 < Ts < np.inf:
        raise RecordError(f"{where}: Ts = {Ts} s; the sampling period must be a number above 0")


def _refuse_missing_signal(table: OpenedTable, roles: Mapping[str, str]) -> None:
    """Refuse a loop without PV or OP, and ask which column it is."""
    columns = table.sheet.columns
    role = next((r for r in ("pv", "op") if r not in roles), None)
    if role is None:
        return
    names = [n for n in columns if not n.startswith(BLANK)]
    numbered = {n: columns[n] for n in names if n.isdigit() and n in columns}
    if numbered:
        raise RecordError(
            f"{table.where}: {len(numbered)} columns have no names; which of them, counted from 1,"
            " is which is needed",
            _option_naming(numbered, names),
        )
    raise with_ranges(no_column(role, dict(roles), names, table.where), table)


def _put_on_even_grid(
    t: np.ndarray, signals: dict[str, np.ndarray], given: float | None, where: str
) -> _EvenSignals:
    """Return signals at even times: values of an archive of changes hold until the next, short
    holes are bridged, and long ones cut the record.
    """
    began = float(t[0])
    Ts = float(np.median(np.diff(t))) if given is None else float(given)
    t, signals, notes = fill_gaps(t, signals, Ts, where)
    # some times count from the record's begin, some are those of the file
    begins = float(t[0]) if t[0] >= began else float(t[0]) + began
    return _EvenSignals(begins, Ts, signals, notes)


def _rows_of(recorded: np.ndarray, held: np.ndarray | None, even: _EvenSignals) -> dict[str, Any]:
    """Return of a record that is kept whole the sample of each row, and where its controller was in
    manual.
    """
    rows = np.rint((recorded - even.begins) / even.Ts).astype(int)
    if held is None or not (held == MAN).any():
        return {"rows": rows}
    times = even.begins + (np.arange(even.signals["pv"].size) + 0.5) * even.Ts
    manual = held[np.searchsorted(recorded, times) - 1] == MAN
    return {"manual": manual, "rows": rows}


def _odd_pace(Ts: float) -> str:
    return (
        f"time: Ts = {Ts:g} s is slower than such loops are recorded; if the times count"
        f" milliseconds, add --ts {Ts / 1000.0:g}"
    )


def _kind_by_tag(tag: str) -> list[str]:
    """Return a note on the kind of loop that the letters of a tag propose (ISA-5.1): FIC101 is a
    flow loop.
    """
    found = _LETTERS.search(tag)
    if found is None:
        return []
    kind = _KIND_OF[found[1]]
    return [f"kind: the letters of tag {tag} propose {kind}; --kind {kind} states it"]


def _mode_held(modes: np.ndarray, name: str, notes: list[str]) -> np.ndarray | None:
    """Return every sample's mode, None where no word of it is understood: a historian stores a mode
    when it changes.
    """
    known = np.flatnonzero(modes != "")
    if not known.size:
        notes.append(f"mode: {name!r} is not understood and counts for nothing")
        return None
    return modes[np.maximum.accumulate(np.where(modes != "", np.arange(modes.size), known[0]))]


def _option_naming(numbered: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return the option that says which columns without a name are signals, and which is the time
    where no other column is.
    """
    cure = example_of_columns(numbered)
    timed = find_time([n for n in names if n not in numbered], {}, "") is not None
    return re.sub(r"t=\d+,", "", cure) if timed else cure


def _automatic(t: np.ndarray, signals: dict[str, np.ndarray], held: np.ndarray, notes: list[str]):
    """Return the longest stretch in automatic or cascade, and say what share of the record either
    is.
    """
    share = {m: float(np.mean(held == m)) for m in (AUTO, CAS, MAN)}
    shares = ", ".join(f"{m} {s:.0%}" for m, s in share.items() if s > 0)
    runs = runs_of(held != MAN)
    lengths = runs[:, 1] - runs[:, 0]
    if share[MAN] == 0.0:
        notes.append(f"mode: {shares} of {held.size} samples")
        return t, signals, 1.0
    if lengths.max(initial=0) < 3:
        notes.append(
            f"mode: {shares}: the controller is never in automatic, which says nothing about cycles"
        )
        return t, signals, 0.0
    a, b = map(int, runs[np.argmax(lengths)])
    part = (
        f"judged samples {a} to {b - 1} of {held.size} ({(b - a) / held.size:.0%}), the longest"
        " stretch in automatic"
    )
    notes.append(f"mode: {shares}; {part}")
    return t[a:b], {role: x[a:b] for role, x in signals.items()}, 1.0 - share[MAN]


def _check_span(record: LoopRecord, where: str) -> list[str]:
    """Refuse a span that is another signal's; note how many samples of a signal lie outside its
    span.
    """
    notes = []
    for name in ("op", "pv"):
        lo, hi = getattr(record, f"{name}_span") or (0.0, 0.0)
        sentence = f"{name.upper()} lies outside {name}_span {lo:g} to {hi:g} in"
        if (share := record.outside(name)) > MOST_OUTSIDE:
            x = getattr(record, name)
            needed = (
                f"it is {x.min():.4g} to {x.max():.4g}; the values that mean 0 and 100 % are needed"
            )
            raise RecordError(f"{where}: {sentence} {share:.0%} of the samples, {needed}")
        if share := record.outside(name, 0.0):
            notes.append(f"span: {sentence} {share:.1%} of the samples")
    return notes
