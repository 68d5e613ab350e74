"""Detect what an archive makes of a signal: values that it holds for longer than chance explains,
and straight lines between those that it stored.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simbench.detectors.signal.conditioning import median

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


# --- Find the samples that an archive interpolated on straight lines between the values that it
# stored.

# of the noise, that rounding may hide before nothing lies on a line but what was drawn on it
_NOISY = 0.3
_LARGE = 100.0  # roundings; of smaller moves, which lie on a line by chance, no share is taken


def on_line(x: np.ndarray, unit: float = 0.0, noise: float = 0.0) -> np.ndarray:
    """Return which samples lie on a straight, not constant line through their neighbours."""
    out = np.zeros(x.size, dtype=bool)
    bend, tolerance = _measure_bends(x, unit, noise)
    out[1:-1] = bend <= tolerance
    return out


def share_on_lines(x: np.ndarray, unit: float = 0.0, noise: float = 0.0) -> float:
    """Return the share of samples that lie on a line through their neighbours beyond those that do
    so by chance.
    """
    bend, tolerance = _measure_bends(x, unit, noise)
    near, beyond, far = np.histogram(bend[np.isfinite(bend)] / tolerance, [0.0, 1.0, 2.0, np.inf])[
        0
    ]
    # the bends of a smooth signal become fewer with size at an even rate; lines have theirs within
    # the rounding or far off
    chance = beyond + beyond**2 / max(far, 1e-9)
    return max(near - chance, 0.0) / max(x.size, 1)


def _measure_bends(x: np.ndarray, unit: float, noise: float) -> tuple[np.ndarray, float]:
    """Return how far each inner sample is off a straight course (inf where nothing moves), and what
    rounding explains of it.
    """
    first = np.diff(x)
    second = np.diff(x, 2)
    exact = 1e-6 * (float(np.ptp(x)) or 1.0)
    tolerance = max(2.1 * unit, exact)
    noisy = tolerance <= _NOISY * noise

    # what has come to rest is straight by itself, but noise never rests
    if noisy:
        least = 0.0
    else:
        least = max(2.0 * unit, 5.0 * exact)
    moving = (np.abs(first[1:]) > least) | (np.abs(first[:-1]) > least)
    typical = 1.4826 * median(np.abs(first))
    seen = moving & (noisy or tolerance <= 0.2 * typical)
    return np.where(seen, np.abs(second), np.inf), tolerance


def straight(x: np.ndarray, unit: float = 0.0) -> tuple[float, int]:
    """Return the share of a signal's movement that runs on straight lines between stored samples,
    and the number of these samples.
    """
    size = np.abs(np.diff(x))
    if size.any():
        usual = median(size[size > 0])
    else:
        usual = 0.0
    large = size > max(0.1 * usual, _LARGE * unit)
    moving = large[1:] & large[:-1]
    on = moving & on_line(x, unit)[1:-1]
    lines = int(np.count_nonzero(on & ~np.append(False, on[:-1])))
    return float(on.sum() / max(int(moving.sum()), 1)), lines
