"""Test whether the valve position follows OP through a straight line or through a dead-band; the
loop need not oscillate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.compiled import compiled
from simbench.detectors.signal.fits.hammerstein_kernels import (
    MOVING_DOWN,
    MOVING_UP,
    Stretch,
    Valves,
    errors,
    state_before,
)
from simbench.detectors.signal.stiction_map import valve_position

_SAMPLES = 800  # at most, after averaging
# lags between valve and its measurement tried, in averaged samples
_TIMES = np.array([1e-3, 2.0, 8.0])
_DELAYS = 4  # averaged samples
_S_SHARES = np.linspace(0.08, 0.98, 24)  # of the range of OP
_J_SHARES = np.array([0.04, 0.4])  # of S: a dead band, and some slip


@dataclass(frozen=True)
class Follow:
    """How a valve position hangs together with OP."""

    S: float  # of the sticky valve that explains the position best, in the unit of OP
    J: float
    # unexplained share of the position's variance, with that valve and with a straight one
    error: float
    error_linear: float
    reversals: int  # of that valve; each is a chance to be wrong

    @property
    def score(self) -> float:
        """Share of the variance that only a sticky valve explains, times how much of the straight
        one's error that is.
        """
        gained = max(self.error_linear - self.error, 0.0)
        if self.reversals:
            return gained * gained / max(self.error_linear, 1e-12)
        return 0.0


def valve_follow(op: np.ndarray, position: np.ndarray, limits=(0.0, 100.0)) -> Follow:
    """Fit a straight and a sticky valve, each with a short lag, to a measured valve position.

    Source: Kano et al. (2004), method A: the position rests while OP moves, then follows;
    here as a comparison of two fitted valves over the whole record. Not for flows that a pressure
    moves more than the valve does: a ramp of pressure that OP compensates looks like a dead band
    until OP turns; hence the count of reversals.
    """
    q = max(1, -(-op.size // _SAMPLES))
    n = op.size // q
    op = np.array(op[: n * q], dtype=float)
    y = position[: n * q].reshape(n, q).mean(axis=1)
    stretch = Stretch(op, y - y.mean(), q, n, _DELAYS + 2, n, 1.0, *(float(x) for x in limits))
    S = np.append(0.0, np.repeat(_S_SHARES * np.ptp(op), _J_SHARES.size))
    J = np.append(0.0, S[1:] * np.tile(_J_SHARES, _S_SHARES.size))

    # every valve with every start and lag
    starts = np.array([MOVING_UP, MOVING_DOWN, 0.0])
    shape = (3, _TIMES.size, S.size)
    valves = (0.0, S, J, starts[:, None, None], np.exp(-1.0 / _TIMES)[:, None])
    valves = (np.broadcast_to(x, shape).ravel() for x in valves)
    out = np.empty((3 * _TIMES.size * S.size, 2))
    low = np.full(len(out), 0 if q > 1 else 1)
    count = np.full(len(out), _DELAYS)
    compiled(errors)(stretch, Valves(*valves, low, count), 1, out)
    error = out[:, 0].reshape(shape).min(axis=1)
    linear = float(error[2, 0])
    best = (linear, 0.0, 0.0, 0.0)
    for start, row in zip(starts.tolist(), error, strict=True):
        k = 1 + int(np.argmin(row[1:]))
        best = min(best, (float(row[k]), float(S[k]), float(J[k]), start))
    error, S_hat, J_hat, start = best
    return Follow(S_hat, J_hat, error, linear, _count_reversals(op, S_hat, J_hat, start, limits))


def _count_reversals(op: np.ndarray, S: float, J: float, start: float, limits) -> int:
    lo, hi = (float(x) for x in limits)
    v = valve_position(op, S, J, state_before(op[0], S, J, start, lo, hi), (lo, hi))
    moves = np.sign(np.diff(v))
    moves = moves[moves != 0]
    return int(np.count_nonzero(moves[1:] != moves[:-1]))
