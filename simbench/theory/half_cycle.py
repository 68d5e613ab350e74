"""The symmetric half cycle of the sampled loop: switching times that reproduce themselves, and
their stability.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from simbench.detectors.compiled import njit_cached
from simbench.theory.march import reversals
from simbench.theory.sampled import SampledLoop

# Derivation. The valve breaks away downwards, moves for m samples and then stands for n samples
# until it breaks away upwards. Between these instants the loop is linear, so the state z = (x, OP,
# v) one sample before a break-away goes to the next one by an affine map Y(m, n), and a symmetric
# cycle is z -> -z. While the valve stands and the dead time has passed, one sample is a fixed
# matrix T, so that n enters as the power T^q, q = n - delay - 2. A sampled valve breaks away at the
# first sample beyond the threshold, half a sample late on average: in the mean cycle the OPs just
# before and just after the break-away lie on average at the distance fs from v. This makes n a real
# number (states between two samples by interpolation). For J = S the map has no constant term and
# only the threshold fixes the size of the cycle; so the threshold takes the place of the row of v
# in z -> -z, and that row is the residual whose zeros in n are sought. m follows from OP, which
# must turn after m samples: iterated until it does. A valve that sticks again after every sample
# has m = 1.


@dataclass(frozen=True, eq=False)
class HalfCycle:
    """A symmetric cycle: the valve moves for `m` samples, stands for `n`, and all repeats with the
    opposite sign.
    """

    # n, m: samples the valve stands and moves
    n: float
    m: int
    x: np.ndarray  # plant state one sample before the valve breaks away downwards
    # op, mv: OP and MV (%, deviations) at that sample
    op: float
    mv: float
    amplitude: float  # half peak-to-peak of OP (%)
    # factor by which a small deviation grows over one half cycle, averaged over where in the sample
    # the switching falls
    multiplier: float

    @property
    def samples(self) -> float:
        """Length of the half cycle in samples."""
        return float(self.n + self.m)

    @property
    def stable(self) -> bool:
        """Whether the cycle attracts."""
        return self.multiplier < 1.0


def half_cycles(loop: SampledLoop) -> list[HalfCycle]:
    """Find the symmetric cycles of a loop, shortest first.

    For L(s) = k e^(-Td s)/s and Ts -> 0 this gives P = 2 S/(k p) + 2 Td + k Td^2 and half
    peak-to-peak S/2 + k p Td/2 of OP, with p = J/(2 - k Td).
    """
    # Half cycles that were found, and the numbers of moving samples that were tried
    found: list[HalfCycle] = []
    tried: set[int] = set()

    # OP turns when the dead time has passed, or later in a slow loop
    if loop.resticks:
        m = 1
    else:
        m = loop.delay + 1
    T = standing(loop)
    waits = np.unique(np.geomspace(1, loop.patience, 160).astype(np.int64)) - 1

    # The turn that a half cycle shows is the next number to try
    while loop.fs > 0 and m not in tried and m < loop.patience:
        tried.add(m)
        turns = []
        for half, Y in _with_moving_samples(loop, T, waits, m):
            length, turn, top = _one_half(loop, half)
            turns.append(turn)
            if abs(turn - m) <= 1 and abs(length - half.samples) <= 2:
                known = any(abs(h.samples - half.samples) <= 3 for h in found)
                if not known:
                    found += [
                        replace(half, amplitude=top, multiplier=_largest_multiplier(Y, T, half))
                    ]
        m = next((t for t in turns if t not in tried), m)
    return sorted(found, key=lambda h: h.samples)


def _with_moving_samples(
    loop: SampledLoop, T: np.ndarray, waits: np.ndarray, m: int
) -> Iterator[tuple[HalfCycle, np.ndarray]]:
    """Yield candidates, their amplitude and multiplier left open, each with its map Y."""
    c = loop.order + 2

    # of z one sample before break-away and of 1: state after the move and the dead time
    head = np.zeros((c, c + 1))
    plant = (loop.A, loop.B_old, loop.B_new, loop.C)
    control = (loop.integral, loop.beta)
    _move_states(plant, control, loop.fd, loop.delay, m, head)
    lows = _sign_changes(head, T, loop.fs, waits)
    if lows.size == 0:
        return

    # Powers of the transition matrix, as high as the waits ask for
    powers = [T]
    while 2 ** len(powers) <= 2 * lows[-1] + 4:
        powers.append(powers[-1] @ powers[-1])

    # Between two whole numbers the solution is interpolated
    for low in lows.tolist():
        at, z, Y = _solve_half_cycle(head, T, powers, loop.fs, (low, low + 1))
        part = at[0] / (at[0] - at[1])
        state = z[0] + part * (z[1] - z[0])
        n = float(loop.delay + 2 + low + part)
        yield (
            HalfCycle(n, m, state[:-2], float(state[-2]), float(state[-1]), np.nan, np.nan),
            Y[0] + part * (Y[1] - Y[0]),
        )


def _solve_half_cycle(
    head, T, powers, fs: float, q: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the residual, z and Y for whole numbers `q` of samples after the head."""
    c = len(head)
    Y = np.empty((len(q), c, c + 1))
    for i, samples in enumerate(q):
        Y[i] = head
        for bit, power in enumerate(powers):
            if (samples >> bit) & 1:
                Y[i] = power @ Y[i]
    mirrored = Y + np.eye(c, c + 1)

    # mean OP around the break-away that began the half cycle
    threshold = -0.5 * (Y[:, -2] + (T @ Y)[:, -2])
    threshold[:, -2] -= 1.0
    threshold[:, -1] += fs
    rows = np.concatenate([mirrored[:, :-1], threshold[:, None]], axis=1)
    rows[np.linalg.det(rows[:, :, :-1]) == 0] = np.nan  # no cycle of this length
    z = np.linalg.solve(rows[:, :, :-1], -rows[:, :, -1:])[:, :, 0]
    return (mirrored[:, -1, :-1] * z).sum(axis=1) + mirrored[:, -1, -1], z, Y


@njit_cached
def _sign_changes(head, T, fs, waits):
    """Return the numbers q of samples after the head where the residual changes its sign from q to
    q + 1.
    """
    # Powers of the transition matrix, by squaring
    c = len(head)
    depth = 1
    while 2**depth <= 2 * waits[-1] + 4:
        depth += 1
    powers = np.empty((depth, c, c))
    _copy_array(T, powers[0])
    for i in range(1, depth):
        _multiply_into(powers[i - 1], powers[i - 1], powers[i])

    # Room for the residuals
    Y = np.empty((c, c + 1))
    other = np.empty((c, c + 1))
    rows = np.empty((c, c + 1))
    found = np.empty(waits.size, dtype=np.int64)
    count = 0

    # Wherever the residual changes its sign, the whole number is found by halving
    before = 0.0
    for i in range(waits.size):
        now = _residual_by_kernel(head, T, powers, fs, waits[i], Y, other, rows)
        if i > 0 and before * now < 0.0:
            low = waits[i - 1]
            high = waits[i]
            while high - low > 1:
                middle = (low + high) // 2
                if _residual_by_kernel(head, T, powers, fs, middle, Y, other, rows) * before > 0.0:
                    low = middle
                else:
                    high = middle
            found[count] = low
            count += 1
        before = now
    return found[:count]


@njit_cached
def _residual_by_kernel(head, T, powers, fs, q, Y, other, rows):
    """Return the residual as `_solve_half_cycle` does, to rounding; NaN where there is no cycle of
    this length.
    """
    # The state after `q` samples at rest, by the powers
    c = len(head)
    _copy_array(head, Y)
    for bit in range(len(powers)):
        if (q >> bit) & 1 == 1:
            _multiply_into(powers[bit], Y, other)
            _copy_array(other, Y)
    _multiply_into(T, Y, other)

    # The equations of a half cycle, whose second half is the first with the other sign
    _copy_array(Y, rows)
    for i in range(c - 1):
        rows[i, i] += 1.0
    for j in range(c + 1):
        rows[c - 1, j] = -0.5 * (Y[c - 2, j] + other[c - 2, j])
    rows[c - 1, c - 1] -= 1.0
    rows[c - 1, c] += fs

    # Gauss with the largest pivot of each column; what is left in the last column is -z
    for k in range(c):
        top = k
        for i in range(k + 1, c):
            if abs(rows[i, k]) > abs(rows[top, k]):
                top = i
        if not abs(rows[top, k]) > 0.0:
            return np.nan
        for j in range(k, c + 1):
            rows[k, j], rows[top, j] = rows[top, j], rows[k, j]
        for i in range(k + 1, c):
            factor = rows[i, k] / rows[k, k]
            for j in range(k, c + 1):
                rows[i, j] -= factor * rows[k, j]

    # Back substitution
    total = Y[c - 1, c]
    for k in range(c - 1, -1, -1):
        for j in range(k + 1, c):
            rows[k, c] -= rows[k, j] * rows[j, c]
        rows[k, c] /= rows[k, k]
        total -= (Y[c - 1, k] + (1.0 if k == c - 1 else 0.0)) * rows[k, c]
    return total


@njit_cached
def _copy_array(source, target):
    """Fill an array (m, n) with another one."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@njit_cached
def _multiply_into(a, b, out):
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
            for k in range(a.shape[1]):
                out[i, j] += a[i, k] * b[k, j]


def _largest_multiplier(Y: np.ndarray, T: np.ndarray, half: HalfCycle) -> float:
    z = np.append(half.x, [half.op, half.mv])

    # a deviation of z moves the next break-away in time: dn/dz from the threshold there, then the
    # total derivative
    growth = T @ Y - Y
    threshold = 0.5 * (Y[-2] + (T @ Y)[-2]) - Y[-1]
    rise = 0.5 * (growth[-2] + (T @ growth)[-2])
    speed = rise[:-1] @ z + rise[-1]
    if speed != 0:
        later = -threshold[:-1] / speed
    else:
        later = np.full(z.size, np.inf)

    # a candidate may grow without bound; it is dropped below
    with np.errstate(over="ignore", invalid="ignore"):
        total = Y[:, :-1] + np.outer(growth[:, :-1] @ z + growth[:, -1], later)
    if np.isfinite(total).all():
        return float(np.abs(np.linalg.eigvals(total)).max())
    return np.inf


def standing(loop: SampledLoop) -> np.ndarray:
    """Return the matrix that advances (x, OP, v) by one sample while the valve stands at v."""
    order = loop.order
    T = np.zeros((order + 2, order + 2))
    T[:order, :order] = loop.A
    T[:order, -1] = loop.B_old + loop.B_new
    T[-1, -1] = 1.0
    w = loop.C @ T[:order]
    T[-2] = -w
    if loop.integral:
        T[-2] -= loop.beta * w
        T[-2, :order] += loop.C
        T[-2, -2] = 1.0
    return T


def _one_half(loop: SampledLoop, half: HalfCycle) -> tuple[int, int, float]:
    """Run the sampled loop through the half cycle: its samples, moving samples and extreme of OP
    (0, 0 when it rests).
    """
    s = np.array([half.op, loop.C @ half.x, half.mv, 1.0, 0.0])
    past = np.full(loop.delay + 2, half.mv)
    run = reversals(loop, half.x.copy(), s, past, 2, most=int(4 * half.samples) + 100)
    if run.count < 2 or run.sample[0] > 2:
        return 0, half.m, np.nan
    return int(run.sample[1] - run.sample[0]), int(run.moved[1]), -float(run.extreme[1])


@njit_cached
def _move_states(plant, control, fd, delay, m, out):
    """Fill `out` with the state m + delay + 2 samples after z, as rows over the columns of z
    and 1; `plant` as in `march`, `control` = (integral, beta).
    """
    # The plant, the controller, and room for their states
    A, B_old, B_new, C = plant
    integral, beta = control
    order = A.shape[0]
    columns = out.shape[1]
    x = np.zeros(order)
    fresh = np.zeros(order)
    v = np.zeros(m + 1)

    # Each column begins with a unit of one state
    for column in range(columns):
        for i in range(order):
            x[i] = 0.0
        u = v[0] = w = 0.0
        if column < order:
            x[column] = 1.0
            w = C[column]
        elif column == order:
            u = 1.0
        elif column == order + 1:
            v[0] = 1.0

        # The last column is the constant
        constant = fd if column == columns - 1 else 0.0

        # Sample by sample: plant, controller, valve
        for k in range(1, m + delay + 3):
            new = v[min(max(k - 1 - delay, 0), m)]
            old = v[min(max(k - 2 - delay, 0), m)]
            y = 0.0
            for i in range(order):
                fresh[i] = B_old[i] * old + B_new[i] * new
                for j in range(order):
                    fresh[i] += A[i, j] * x[j]
                y += C[i] * fresh[i]
            for i in range(order):
                x[i] = fresh[i]
            if integral:
                u = u - (y - w) - beta * y
            else:
                u = -y
            w = y
            if k <= m:
                v[k] = u + constant

        # The state at the end is the column
        for i in range(order):
            out[i, column] = x[i]
        out[order, column] = u
        out[order + 1, column] = v[m]
