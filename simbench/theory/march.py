"""The sampled loop without noise, marched from one reversal of the valve to the next; compiled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.compiled import njit_cached

_ENDED = 0
_STALLED = 1
_SPENT = 2


@njit_cached
def march(plant, control, valve, state, n_max, stall, out):
    """Advance the loop in place until `out` is full of reversals, the valve stalls, or `n_max`
    samples are spent.

    `plant` = (A, B_old, B_new, C), scaled so that C x is what the controller subtracts from OP;
    `control` = (integral, beta, lo, hi); `valve` = (fs, fd, whether it sticks again after every
    sample). `state` = (x of the plant, [OP, C x, v, direction, moving], the last delay + 2 valve
    positions, newest last). `out`, shape (4, reversals): the sample of the break-away, and of the
    half cycle that it ends the extreme of OP, the position where the valve stopped, and the number
    of samples from break-away to the last stop. All positions are deviations from rest in %.
    Returns (reversals, samples, how it ended).
    """
    # The parts, and room for what is found
    A, B_old, B_new, C = plant
    integral, beta, lo, hi = control
    fs, fd, resticks = valve
    x, s, past = state
    samples = out[0]
    extreme = out[1]
    stop = out[2]
    moved = out[3]

    # The state, in local names
    order = x.shape[0]
    depth = past.shape[0]
    fresh = x.copy()
    u = s[0]
    w = s[1]
    v = s[2]
    direction = s[3]
    moving = s[4]
    top = bottom = u
    found = 0
    last = 0
    newest = depth - 1
    k = 0
    how = _SPENT
    stood = 0

    # The plant answers to positions of one dead time ago
    while k < n_max:
        k += 1
        new = past[(newest + 2) % depth]
        old = past[(newest + 1) % depth]
        y = 0.0
        for i in range(order):
            fresh[i] = B_old[i] * old + B_new[i] * new
            for j in range(order):
                fresh[i] += A[i, j] * x[j]
            y += C[i] * fresh[i]
        for i in range(order):
            x[i] = fresh[i]

        # The controller, within its limits
        before = u
        if integral:
            u = u - (y - w) - beta * y
        else:
            u = -y
        u = min(max(u, lo), hi)
        w = y

        # The valve stops where OP turns, and slips once OP has crossed the band
        if moving == 1.0 and (resticks or (u - before) * direction <= 0.0):
            moving = 0.0
            stood = k
        if moving == 0.0 and abs(u - v) > fs:
            side = 1.0 if u > v else -1.0
            moving = 1.0

            # A slip the other way is a reversal
            if side != direction:
                samples[found] = k
                extreme[found] = top if side < 0.0 else bottom
                stop[found] = v
                moved[found] = stood - last
                found += 1
                last = k
                direction = side
                top = bottom = before

        # A moving valve follows; extremes and positions are kept
        if moving == 1.0:
            v = min(max(u - direction * fd, lo), hi)
        top = max(top, u)
        bottom = min(bottom, u)
        newest = (newest + 1) % depth
        past[newest] = v

        # Enough reversals, or none for too long
        if found == samples.shape[0]:
            how = _ENDED
            break
        if k - last > stall:
            how = _STALLED
            break

    # The state as it is left, the oldest position first
    s[0] = u
    s[1] = w
    s[2] = v
    s[3] = direction
    s[4] = moving
    turned = past.copy()
    for i in range(depth):
        past[i] = turned[(newest + 1 + i) % depth]
    return found, k, how


@dataclass(frozen=True, eq=False)
class _Reversals:
    """Where the valve turned in a marched loop; arrays over the `count` half cycles that ended."""

    sample: np.ndarray  # sample of the break-away into the other direction
    extreme: np.ndarray  # largest (moving up) or smallest OP (%) of the half cycle that ended there
    stop: np.ndarray  # position (%) where the valve had stopped
    moved: np.ndarray  # samples from the half cycle's own break-away to its last stop
    samples: int  # length of the march
    stalled: bool  # whether the valve stopped reversing

    @property
    def count(self) -> int:
        """Number of reversals."""
        return len(self.sample)


def reversals(
    loop, x: np.ndarray, s: np.ndarray, past: np.ndarray, count: int, most: int = 2**62
) -> _Reversals:
    """March a loop until its valve has reversed `count` times."""
    arrays = np.zeros((4, count))
    plant = (loop.A, loop.B_old, loop.B_new, loop.C)
    control = (loop.integral, loop.beta, loop.lo, loop.hi)
    valve = loop.fs, loop.fd, loop.resticks
    state = x, s, past
    found, samples, how = march(plant, control, valve, state, most, loop.patience, arrays)
    return _Reversals(*arrays[:, :found], samples=samples, stalled=how == _STALLED)
