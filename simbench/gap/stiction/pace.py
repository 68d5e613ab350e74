"""Thin out a record that is sampled much faster than its loop moves, because between close samples
a first-order plant model fails.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simbench.detectors.quality import steps
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.lines import share_on_lines
from simbench.detectors.signal.oscillation import find_oscillation

_LEAST = 0.2  # share of PV's standard deviation that PV moves from sample to sample
SHORTEST_LEFT = 250  # samples that are left
_REGULAR = 0.9  # share of PV's changes that fall on every k-th sample, where PV is held for k
HELD = 100  # samples that are left of a PV that is held, at least
# samples of a period that are left of a sustained oscillation: a larger drift may be added to it
_FEWEST = 20.0


def at_its_pace(record: LoopRecord) -> LoopRecord:
    """Return a record with so many samples left out that PV moves from one to the next; the same
    where it moves already.

    A sine keeps some thirty samples a period, an oscillation with a larger drift twenty; noise of
    a seventh of PV's standard deviation keeps all.
    """
    pv, k = np.asarray(record.pv), 1
    swing = find_oscillation(record.op, pv, record.Ts)
    most = swing.period_s / record.Ts / _FEWEST if swing.sustained else np.inf
    while k + 1 <= min(most, pv.size // SHORTEST_LEFT) and np.std(
        pv[k:] - pv[:-k]
    ) < _LEAST * np.std(pv):
        k += 1
    return record if k == 1 else resampled(record, lambda x: x[::k], k)


def unheld(record: LoopRecord) -> LoopRecord:
    """Return a record whose PV is held for k samples with the first of each k alone; the same where
    it is not held.
    """
    changes = np.flatnonzero(np.diff(np.asarray(record.pv))) + 1
    if changes.size < HELD:
        return record
    k = int(np.median(np.diff(changes)))
    phase = int(np.bincount(changes % k).argmax())
    regular = k > 1 and np.mean(changes % k == phase) >= _REGULAR
    return resampled(record, lambda x: x[phase::k], k) if regular else record


def measured_samples(record: LoopRecord) -> int:
    """Return how many samples of PV were measured: an archive repeats the others, or draws straight
    lines between them.
    """
    pv = np.asarray(record.pv)
    drawn = share_on_lines(pv, steps(pv, record.op)) + float(np.mean(np.diff(pv) == 0.0))
    return round(pv.size * max(1.0 - drawn, 0.0))


def resampled(record: LoopRecord, change: Callable[[np.ndarray], np.ndarray], k: int) -> LoopRecord:
    """Return a record in which every signal but MV, which is left out, has one sample in place of
    k.
    """
    return replace(record, mv=None).with_signals(change, Ts=record.Ts * k)
