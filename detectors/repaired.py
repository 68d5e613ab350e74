"""Take out of a record what its own samples contradict: wild single samples and frozen stretches.

The verbs that ask about the valve alone (detect, diagnose, conclude, trust) look at the repaired
record. A diagnosis of the gap looks at the record as it is: outliers and a frozen sensor are
effects that it names.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.quality import steps
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import Standstill, frozen, runs_of
from simbench.detectors.signal.lines import straight
from simbench.detectors.signal.spikes import cleaned, isolated, off_line
from simbench.detectors.signal.tails import heavy_tails

# ranges of nine tenths of a signal, by which a sample lies outside that range and cannot belong to
# it: Gaussian samples 12 standard deviations from their mean, samples of a sine 7 amplitudes
_FAR = 3.0
_AT_ONCE = 5  # samples in a row that are bridged; what lasts longer is no single sample
_DRAWN = 0.1  # share of moving samples on straight lines, from which an archive drew a signal
_SHORTEST = 3  # samples of a record
_WILD, _FROZEN = "outliers", "frozen"  # what notes begin with


def repaired(record: LoopRecord) -> LoopRecord:
    """Return a record without wild samples and without frozen stretches.

    Up to five samples in a row that lie far outside all others, and single ones off a smooth
    course, count as missing and are bridged by a straight line. Where PV or OP stands still for far
    longer than it does elsewhere, the longer of the parts before and after is kept.

    Parameters
    ----------
    record : LoopRecord
        Signals of shape (n,).

    Returns
    -------
    LoopRecord
        The same record where nothing contradicts; else signals of shape (m,), m <= n, and one note
        for the samples of each signal and for each stretch.

    Notes
    -----
    Own rules. Not for judging the sensor or the archive: what they did is no longer there.

    Examples
    --------
    >>> t = np.arange(400.0)
    >>> pv = np.sin(t / 8)
    >>> pv[90] = 1e6
    >>> repaired(LoopRecord(op=-np.sin(t / 8), pv=pv, Ts=1.0)).notes
    ('outliers: 1 sample of PV contradicts its neighbours on both sides and counts as missing',)
    """
    return _thawed(_without_wild(record))


def _without_wild(record: LoopRecord) -> LoopRecord:
    """Return the record with wild samples of OP and PV bridged."""
    bridged, notes = {}, []
    for name, other in (("pv", record.op), ("op", record.pv)):
        x = getattr(record, name)
        wild = _outside(x)
        wild[_spikes(cleaned(x, np.flatnonzero(wild)), other)] = True
        count = int(wild.sum())
        if count:
            bridged[name] = cleaned(x, np.flatnonzero(wild))
            what = "1 sample" if count == 1 else f"{count} samples"
            does = "contradicts its" if count == 1 else "contradict their"
            notes.append(
                f"{_WILD}: {what} of {name.upper()} {does} neighbours on both sides and"
                f" {'counts' if count == 1 else 'count'} as missing"
            )
    return replace(record, **bridged, notes=(*record.notes, *notes)) if notes else record


def _outside(x: np.ndarray) -> np.ndarray:
    """Return which samples, up to five in a row, lie far outside all others."""
    wild = np.zeros(x.size, dtype=bool)
    # one value that stands for "none" may be repeated often, and must not widen the range
    usual = x[(x != x.min()) & (x != x.max())]
    if 2 * usual.size < x.size:
        usual = x
    low, high = np.quantile(usual, [0.05, 0.95])
    far = _FAR * (high - low)
    if far > 0.0:
        for begin, end in runs_of((x < low - far) | (x > high + far)):
            wild[begin:end] = end - begin <= _AT_ONCE
    return wild


def _spikes(x: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the single samples off a smooth course; none where an archive drew it or noise has
    such samples.
    """
    step = steps(x, other)
    spikes = isolated(x, step)[0]
    if spikes.size and (straight(x, step)[0] > _DRAWN or heavy_tails(off_line(x)[0])):
        return spikes[:0]
    return spikes


def _thawed(record: LoopRecord) -> LoopRecord:
    """Return the longer part of a record before or after a stretch in which PV or OP is frozen."""
    while (frozen_part := _frozen(record)) is not None:
        names, (begin, end, _) = frozen_part
        part = (0, begin) if begin >= record.n - end else (end, record.n)
        if part[1] - part[0] < _SHORTEST:
            break
        note = (
            f"{_FROZEN}: {' and '.join(names)} {'stand' if len(names) > 1 else 'stands'} still from"
            f" sample {begin} to {end - 1} of {record.n}; judged samples {part[0]} to {part[1] - 1}"
        )
        record = replace(record.window(*part), notes=(*record.notes, note))
    return record


def _frozen(record: LoopRecord) -> tuple[list[str], Standstill] | None:
    """Return the longest frozen stretch and what stands still in it; None where nothing does.

    OP at an end of its range is at a limit while PV moves on.
    """
    pv, op = frozen(record.pv), frozen(record.op)
    if pv is None and op is not None and record.op[op.begin] in (record.op.min(), record.op.max()):
        return None
    found = [(name, s) for name, s in (("PV", pv), ("OP", op)) if s is not None]
    if not found:
        return None
    longest = max((s for _, s in found), key=lambda s: s.end - s.begin)
    return [n for n, s in found if s.begin < longest.end and longest.begin < s.end], longest
