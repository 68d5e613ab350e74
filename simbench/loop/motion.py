"""How a valve moves: its reversals, swings and period, and the largest sine in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.signal.conditioning import median

MIN_REVERSALS = 6  # of a valve that cycles


@dataclass(frozen=True)
class Motion:
    """Reversals of a valve position."""

    # (m,) sample indices of the reversals: the last sample before the valve turns back
    at: np.ndarray
    positions: np.ndarray  # (m,) position (%) there
    n: int  # samples looked at

    @property
    def reversals(self) -> int:
        """Number of reversals."""
        return self.at.size

    @property
    def swings(self) -> np.ndarray:
        """Distances (%) between consecutive reversals, shape (m - 1,)."""
        return np.abs(np.diff(self.positions))

    @property
    def swing(self) -> float:
        """Median swing (%); 0 without two reversals."""
        if self.at.size > 1:
            return median(self.swings)
        return 0.0

    @property
    def period(self) -> float:
        """Mean time of two swings, in samples; NaN with fewer than three reversals."""
        if self.at.size > 2:
            return 2.0 * float(self.at[-1] - self.at[0]) / (self.at.size - 1)
        return float("nan")

    @property
    def lasting(self) -> float:
        """Median swing in the last third over that in the first; 0 when the last third is still."""
        middle = 0.5 * (self.at[1:] + self.at[:-1])
        first = self.swings[middle < self.n / 3]
        last = self.swings[middle >= 2 * self.n / 3]
        if last.size == 0:
            return 0.0
        if first.size:
            return median(last) / median(first)
        return float("inf")


def least_swing(bands: list[tuple[float, float]]) -> float:
    """Return the smallest swing of MV (%) that counts as a cycle: J/2, or S/20 without slip jump;
    `bands` are the (S, J) of the valve's stages.
    """
    S, J = (max((band[i] for band in bands), default=0.0) for i in (0, 1))
    return max(J / 2 if J > 0 else S / 20, 1e-6)


def motion(mv: np.ndarray, least: float) -> Motion:
    """Find where a valve turns back by more than `least`."""
    # Samples in which the valve moved
    v = np.asarray(mv, dtype=float)
    moves = np.flatnonzero(v[1:] != v[:-1])

    # the only candidates: last samples of a stay between a move up and a move down
    up = v[moves + 1] > v[moves]
    turn = np.flatnonzero(up[1:] != up[:-1]) + 1
    at = moves[turn].tolist()
    value = v[moves[turn]].tolist()
    at.append(v.size - 1)
    value.append(float(v[-1]))

    # A reversal is a stay from which it goes back by more than `least`
    best = 0
    high = float(v[0])
    low = float(v[0])
    direction = 0
    found = []
    for i, x in zip(at, value):
        if direction == 0:
            high = max(high, x)
            low = min(low, x)
            if x - low > least or high - x > least:
                direction = 1 if x - low > least else -1
                best = i
                high = x
                low = x
        elif (x - high) * direction >= 0:
            best = i
            high = x
        elif (high - x) * direction > least:
            found.append((best, high))
            direction = -direction
            best = i
            high = x
    places = np.array([i for i, _ in found], dtype=int)
    return Motion(places, v[places], v.size)


def largest_sine(x: np.ndarray, period: float, factor: float = 3.0) -> float:
    """Return the largest amplitude of a sine in a signal, over periods within a factor of the given
    one.
    """
    x = np.asarray(x, dtype=float) - np.mean(x)
    # zero-padded fourfold: a sine between two bins loses 3 % at most
    size = 4 << (x.size - 1).bit_length()
    amplitude = np.abs(np.fft.rfft(x, size)) * (2.0 / x.size)
    lo = max(int(np.floor(size / (period * factor))), 1)
    hi = min(int(np.ceil(size * factor / period)), amplitude.size - 1)
    if lo <= hi:
        return float(amplitude[lo : hi + 1].max())
    return 0.0
