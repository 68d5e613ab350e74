"""Find the intervals in which a valve does not move although OP does."""

from __future__ import annotations

import numpy as np

from simbench.detectors.signal.conditioning import clear_harmonics, drift, noise_variance, smooth
from simbench.detectors.signal.holds import runs_of

# movement over a twentieth of the period, in std of the valve's position, below which the valve
# stands still
_STILL = 0.1
_SHORTEST_STANDSTILL = 0.05  # shortest standstill, as a share of the period
# bound over std at which a valve that follows a sine would seem to stand still in most places
_NOISY = 0.3


def steady_valve(mv: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return the valve position without its noise, and where it rests.

    Own. Not for drift faster than the oscillation.
    """
    harmonics = clear_harmonics(mv, period)
    clean = smooth(mv, period / harmonics)
    # even: read backwards, a record rests at the same samples
    reach = 2 * max(round(0.025 * period), 1)
    left = 2.0 * noise_variance(mv) * min(2.0 * harmonics / period, 1.0)
    spread = float((clean - drift(clean, period)).std())
    bound = max(_STILL * spread, 3.0 * left**0.5)
    still = np.pad(np.abs(clean[reach:] - clean[:-reach]) <= bound, reach // 2)
    return clean, still, bound < _NOISY * spread


def stuck_intervals(
    op: np.ndarray, still: np.ndarray, period: float, least_op: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the intervals in which the valve rests while OP moves."""
    edges = runs_of(still).ravel()
    start = edges[::2]
    stop = edges[1::2]
    if start.size == 0:
        return np.zeros(0, dtype=int), np.zeros(0)
    padded_op = np.append(op, op[-1])  # so that the last interval may end with the record
    moved = (np.maximum.reduceat(padded_op, edges) - np.minimum.reduceat(padded_op, edges))[::2]
    counts = (stop - start >= _SHORTEST_STANDSTILL * period) & (moved >= least_op)
    return (stop - start)[counts], moved[counts]
