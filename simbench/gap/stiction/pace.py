"""A record sampled no more densely than its loop moves: between closer samples lies what no plant of first order describes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from detectors.record import LoopRecord
from detectors.signal.oscillation import find_oscillation

LEAST = 0.2  # of PV's standard deviation, that PV moves from sample to sample
SHORTEST = 250  # samples that are left
FEWEST = 20.0  # samples of a period that are left of a sustained oscillation: it may stand beside a larger drift


def at_its_pace(record: LoopRecord) -> LoopRecord:
    """Return a record with so many samples left out that PV moves from one to the next.

    Parameters
    ----------
    record : LoopRecord

    Returns
    -------
    LoopRecord
        The same where PV moves already, or too few samples would be left.

    Notes
    -----
    A sine keeps some thirty samples a period, an oscillation beside a larger drift twenty; noise of a seventh of PV's standard
    deviation keeps all.

    Examples
    --------
    >>> t = np.arange(4000)
    >>> at_its_pace(LoopRecord(op=np.cos(t / 50), pv=np.sin(t / 50), Ts=1.0)).Ts
    11.0
    """
    pv, k = np.asarray(record.pv), 1
    swing = find_oscillation(record.op, pv, record.Ts)
    most = swing.period_s / record.Ts / FEWEST if swing.sustained else np.inf
    while k + 1 <= min(most, pv.size // SHORTEST) and np.std(pv[k:] - pv[:-k]) < LEAST * np.std(pv):
        k += 1
    return record if k == 1 else resampled(record, lambda x: x[::k], k)


def resampled(record: LoopRecord, change: Callable[[np.ndarray], np.ndarray], k: int) -> LoopRecord:
    """Return a record in which every signal but MV, which is left out, has one sample in place of k.

    Parameters
    ----------
    record : LoopRecord
    change : function of ndarray
    k : int

    Returns
    -------
    LoopRecord
    """
    signals = {name: change(getattr(record, name)) for name in ("op", "pv", "sp") if getattr(record, name) is not None}
    return replace(record, Ts=record.Ts * k, mv=None, **signals)
