"""Keep of a record the samples that were measured, and tell how many there are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simbench.detectors.quality import steps
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.lines import share_on_lines

_REGULAR = 0.9  # share of PV's changes that fall on every k-th sample, where PV is held for k
HELD = 100  # samples that are left of a PV that is held, at least


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
    if regular:
        return resample_record(record, lambda x: x[phase::k], k)
    return record


def measured_samples(record: LoopRecord) -> int:
    """Return how many samples of PV were measured: an archive repeats the others, or draws straight
    lines between them.
    """
    pv = np.asarray(record.pv)
    drawn = share_on_lines(pv, steps(pv, record.op)) + float(np.mean(np.diff(pv) == 0.0))
    return round(pv.size * max(1.0 - drawn, 0.0))


def resample_record(
    record: LoopRecord, change: Callable[[np.ndarray], np.ndarray], k: int
) -> LoopRecord:
    """Return a record in which every signal but MV, which is left out, has one sample in place of
    k.
    """
    return replace(record, mv=None).with_signals(change, Ts=record.Ts * k)


def op_range(op: np.ndarray) -> float:
    """Return the range of OP (n,) without its rarest hundredths."""
    return float(np.quantile(op, 0.99) - np.quantile(op, 0.01))
