"""Detect a signal that stays exactly constant for longer than chance explains."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_FROZEN = 0.05  # share of a record, and ...
_FEWEST = 20  # ... samples, beyond which a standstill is frozen, if it is ...
_LONGER = 3.0  # ... so many times as long as the three next ones
_SELDOM = 1e-3  # standstills of a length that a record of noise has by chance; longer ones are none


def still(x: np.ndarray) -> bool:
    """Return whether a signal never changes by more than rounding."""
    return bool(np.ptp(x) <= 1e-9 * np.abs(x).max())


def holds(x: np.ndarray) -> np.ndarray:
    """Return the lengths of the runs of equal samples, in order."""
    edges = np.flatnonzero(np.diff(x)) + 1
    return np.diff(np.concatenate([[0], edges, [x.size]]))


class Standstill(NamedTuple):
    """A stretch in which a signal stands still for far longer than elsewhere.

    `begin` its first sample, `end` the one after it, `usual` the samples of its other standstills.
    """

    begin: int
    end: int
    usual: float


def frozen(x: np.ndarray) -> Standstill | None:
    """Return the stretch in which a signal is frozen, the longest; None where it is not."""
    runs = holds(x)
    k = int(runs.argmax())
    longest = int(runs[k])
    if runs.size > 3:
        usual = float(np.sort(runs)[-4:-1].mean())
    else:
        usual = 1.0
    if longest <= max(_FEWEST, _FROZEN * x.size) or longest <= _LONGER * usual:
        return None
    begin = int(runs[:k].sum())
    return Standstill(begin, begin + longest, usual)


def runs_of(x: np.ndarray) -> np.ndarray:
    """Return begin and end, shape (k, 2), of every run of true samples, in order."""
    return np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(x, dtype=int), [0]]))).reshape(
        -1, 2
    )


def stuck(x: np.ndarray, unit: float = 0.0) -> float:
    """Return the share of samples in exact standstills longer than noise, rounded to `unit`, has by
    chance.
    """
    change = np.diff(x)
    blocks = [b[b != 0.0] for b in np.array_split(change, max(x.size // 50, 1))]
    moving = [1.4826 * float(np.median(np.abs(b))) for b in blocks if b.size >= 10]
    if len(moving) < 0.7 * len(blocks):
        return 0.0
    # the quietest tenth of the record shows how often two neighbours agree
    agree = unit / (2.5 * float(np.quantile(moving, 0.1)))
    if agree > 0.5:
        return 0.0
    longest = 1.0 + np.log(_SELDOM / x.size) / np.log(max(agree, 1e-9))
    runs = holds(x)
    return float(runs[runs > max(longest, 4.0)].sum() / x.size)
