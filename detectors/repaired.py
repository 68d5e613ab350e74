"""Take out of a record what its own samples contradict: wild single samples and a frozen stretch;
and look at PV in a unit in which its swing is an ordinary number.

Every verb looks at the repaired record where it is all that is known of a loop. Beside a loop file
the record is looked at as it is: outliers and a frozen sensor are effects that are named.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import frozen, runs_of
from simbench.detectors.signal.spikes import cleaned

# ranges of nine tenths of a signal, by which a sample lies outside that range and cannot belong to
# it: Gaussian samples 12 standard deviations from their mean, samples of a sine 7 amplitudes
_FAR = 3.0
_NEAR = 0.5  # of that distance, within which both neighbours must lie: else a wave runs through
_AT_ONCE = 5  # samples in a row that are bridged; what lasts longer is no single sample
# of PV's range, between which it is judged as it was given; beyond them, a limit that guards a
# division somewhere may be no longer small, or no longer large
_ORDINARY = (1e-3, 1e6)
_REMOTE = 1e4  # ranges of PV by which it may lie off 0: with more, digits are lost on the offset
_MOST = 0.5  # share of a record that may be frozen; a loop at rest stands still for longer


# what the kind of a loop says of its process; a pressure, temperature or concentration may be of
# either type
_PROCESS_OF = {"flow": "self-regulating", "level": "integrating"}


def with_implied_process(record: LoopRecord) -> LoopRecord:
    """Return a record with the type of process that the kind of its loop implies, and a note on it,
    where only the kind is stated.

    >>> t = np.arange(400.0)
    >>> level = LoopRecord(op=-np.sin(t / 8), pv=np.cos(t / 8), Ts=1.0, kind="level")
    >>> with_implied_process(level).notes
    ('process: a level loop; judged as integrating, unless --process states another',)
    """
    process = _PROCESS_OF.get(record.kind or "")
    if process is None or record.process is not None:
        return record
    note = f"process: a {record.kind} loop; judged as {process}, unless --process states another"
    return replace(record, process=process, notes=record.notes + (note,))


def repair_record(record: LoopRecord) -> LoopRecord:
    """Return a record without wild samples and without a frozen stretch, PV in an ordinary unit.

    Up to five samples in a row that lie far outside all others count as missing and are bridged by
    a straight line. Where PV and OP stand still together for far longer than elsewhere, but not for
    most of the record, the longer of the parts before and after is kept.

    Spikes within the signal's range stay: slips of sticky valves look like them. So does PV that
    rests alone, which may be that of a valve that sticks.

    PV and SP are multiplied by a power of ten where PV spans less than 1e-3 or more than 1e6, and
    lose an offset of more than 10 000 times what PV spans: no conclusion depends on the unit.

    Parameters
    ----------
    record : LoopRecord
        Signals of shape (n,).

    Returns
    -------
    LoopRecord
        The same record where nothing contradicts; else signals of shape (m,), m <= n, and one note
        for the samples of each signal, for the stretch, and for the unit.

    Notes
    -----
    Own rules. Not for judging the sensor or the archive: what they did is no longer there.

    Examples
    --------
    >>> t = np.arange(400.0)
    >>> pv = np.sin(t / 8)
    >>> pv[90] = 1e6
    >>> repair_record(LoopRecord(op=-np.sin(t / 8), pv=pv, Ts=1.0)).notes
    ('outliers: 1 sample of PV contradicts its neighbours on both sides and counts as missing',)
    """
    return _in_ordinary_unit(_cut_frozen(_without_wild(with_implied_process(record))))


def _without_wild(record: LoopRecord) -> LoopRecord:
    """Return the record with wild samples of OP and PV bridged."""
    # Wild samples of either signal, each bridged
    bridged = {}
    notes = []
    for name in ("pv", "op"):
        wild = _find_outliers(getattr(record, name))
        count = wild.size
        if count:
            bridged[name] = cleaned(getattr(record, name), wild)
            if count == 1:
                what = "1 sample"
            else:
                what = f"{count} samples"
            does = "contradicts its" if count == 1 else "contradict their"
            notes.append(
                f"outliers: {what} of {name.upper()} {does} neighbours on both sides and"
                f" {'counts' if count == 1 else 'count'} as missing"
            )

    # A record without any is left as it is
    if not notes:
        return record
    mended = replace(record, **bridged)
    said = record.notes
    if record.op_percent is None and mended.op_percent is not None:
        # what the reader said about the unit of OP was about the wild samples
        said = tuple(note for note in said if not note.startswith("unit: OP runs from"))
    return replace(mended, notes=said + tuple(notes))


def _find_outliers(x: np.ndarray) -> np.ndarray:
    """Return the samples, up to five in a row, that lie far outside all others, by their index; the
    top of a wave, whose neighbours are nearly as far out, is none of them.
    """
    wild = np.zeros(x.size, dtype=bool)

    # one value that stands for "none" may be repeated often, and must not widen the range
    usual = x[(x != x.min()) & (x != x.max())]
    if 2 * usual.size < x.size:
        usual = x
    low, high = np.quantile(usual, [0.05, 0.95])
    far = _FAR * (high - low)
    if far > 0.0:
        for begin, end in runs_of((x < low - far) | (x > high + far)):
            beside = x[[k for k in (begin - 1, end) if 0 <= k < x.size]]
            apart = max(low - float(beside.min()), float(beside.max()) - high, 0.0)
            wild[begin:end] = end - begin <= _AT_ONCE and apart <= _NEAR * far
    return np.flatnonzero(wild)


def _cut_frozen(record: LoopRecord) -> LoopRecord:
    """Return the longer part before or after a stretch in which PV and OP are frozen."""
    # A stretch in which nothing moves, and that is not most of the record
    moves = (np.diff(record.pv) != 0.0) | (np.diff(record.op) != 0.0)
    stretch = frozen(np.append(0, np.cumsum(moves)))
    if stretch is None or stretch.end - stretch.begin > _MOST * record.n:
        return record
    begin, end, _ = stretch

    # The longer part beside it
    if begin >= record.n - end:
        part = (0, begin)
    else:
        part = (end, record.n)
    note = (
        f"frozen: PV and OP stand still from sample {begin} to {end - 1} of {record.n};"
        f" judged samples {part[0]} to {part[1] - 1}"
    )
    return replace(record.window(*part), notes=record.notes + (note,))


def _in_ordinary_unit(record: LoopRecord) -> LoopRecord:
    """Return the record with PV, SP and PV's span in a unit in which PV's swing is an ordinary
    number.
    """
    # The range of PV, and the power of ten that makes it ordinary
    low = float(record.pv.min())
    high = float(record.pv.max())
    if not low < high:
        return record
    decade = 10.0 ** np.floor(np.log10(high - low))
    if _ORDINARY[0] <= high - low <= _ORDINARY[1]:
        factor = 1.0
    else:
        factor = 1.0 / decade

    # a whole number of decades leaves the digits where they were
    offset = decade * np.round(0.5 * (low + high) / decade)
    offset = offset if abs(offset) > _REMOTE * (high - low) else 0.0
    if factor == 1.0 and offset == 0.0:
        return record

    # The note says what was done
    if offset:
        less = f" less {offset:g}"
    else:
        less = ""
    if factor != 1.0:
        times = f" times {factor:g}"
    else:
        times = ""
    span = record.pv_span
    return replace(
        record,
        pv=(record.pv - offset) * factor,
        sp=None if record.sp is None else (record.sp - offset) * factor,
        pv_span=None if span is None else tuple((x - offset) * factor for x in span),
        notes=record.notes + (f"unit: PV spans {high - low:.3g}; judged as PV{less}{times}",),
    )
