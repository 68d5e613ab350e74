"""Measure the distance between two loops by phase-free features of SP, OP and PV, in units of the
spread between seeds.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.signal import welch

RESOLVABLE = 1.5  # gap over floor from which a gap counts as resolvable
# seed spreads a single feature can add: a share that is exactly 0 in the simulation must not decide
# alone
_CAP = 40.0
# a loop that hardly varies from seed to seed must not turn differences that mean nothing into a gap
_LEAST_FLOOR = 0.3
_BANDS = 6


class Signals(NamedTuple):
    """What a historian shows: SP and PV in PV units, OP and MV in %, each of shape (n,)."""

    sp: np.ndarray
    op: np.ndarray
    pv: np.ndarray
    mv: np.ndarray


class Scale(NamedTuple):
    """What the features are measured in."""

    # Ts, speed: sampling period and closed-loop time scale (s)
    Ts: float
    speed: float
    unit: float  # PV units per %
    noise_std: float  # measurement noise (PV units)
    step_unit: float  # PV units per % of OP's answer to a set-point step
    sp_moves: bool


def features(s: Signals, scale: Scale) -> tuple[np.ndarray, np.ndarray]:
    """Return what the record looks like regardless of phase, and the difference below which each
    number means nothing.

    Means are left out: operating point and mean load are never an effect.
    """
    pv, op = (s.pv - s.sp) / scale.unit, s.op
    tiny = 1e-3 * scale.noise_std / scale.unit
    rows: list[tuple[float, float]] = []

    def log(x: float, blur: float = 0.05) -> None:
        rows.append((float(np.log(max(x, 1e-12))), blur))

    def share(x: float, blur: float = 0.02) -> None:
        rows.append((float(x), blur))

    dpv, dop = np.diff(s.pv) / scale.unit, np.diff(op)
    for x in (pv, op, dpv, dop):
        log(x.std() + tiny)
    log((np.diff(dpv).std() + tiny) / (dpv.std() + tiny))
    log((np.diff(dop).std() + tiny) / (dop.std() + tiny))
    for x in (pv, op):
        f, power = welch(x, nperseg=min(512, x.size // 2))
        edges = np.geomspace(f[1], 0.5, _BANDS + 1)
        for lo, hi in pairwise(edges):
            inside = (f >= lo * 0.999) & (f < hi * 1.001)
            log(float(power[inside].mean()) + tiny**2, 0.1)
    for x in (pv, op, dpv, dop):
        z = x - x.mean()
        log(float(np.mean(z**4)) / (float(np.mean(z**2)) ** 2 + tiny**4) + 0.1)
    share(np.mean(np.abs(dpv) < 1e-6 * tiny))
    share(np.mean(np.abs(dop) < 1e-9))
    share(np.mean(np.abs(np.diff(dpv)) < 30 * tiny))
    share(np.mean(op > op.max() - 1e-6) + np.mean(op < op.min() + 1e-6))
    for x in (s.pv / scale.unit, op):
        share(np.unique(np.round(x / (1e-3 * tiny))).size / x.size, 0.15)
        block = x[: x.size // 10 * 10].reshape(10, -1).mean(1)
        log(block.std() + 10 * tiny)
    lag = max(1, round(scale.speed / scale.Ts))
    for k in (0, lag, -lag):
        share(_correlation(pv, op, k), 0.03)
    share(_loop_area(pv, op), 0.03)
    for x in (pv, op):
        share(_regularity(x), 0.03)
    if scale.sp_moves:
        rows.extend((value, 0.03) for value in _answer_to_steps(s, scale, lag))
    values, meaningless = np.array(rows).T
    return values, meaningless


def _correlation(x: np.ndarray, y: np.ndarray, lag: int) -> float:
    a, b = (x[lag:], y[: y.size - lag]) if lag >= 0 else (x[:lag], y[-lag:])
    spread = a.std() * b.std()
    return float(np.mean((a - a.mean()) * (b - b.mean())) / spread) if spread > 0 else 0.0


def _loop_area(x: np.ndarray, y: np.ndarray) -> float:
    """Signed area the PV-OP trajectory sweeps per sample, in units of the signals' steps."""
    area = np.mean((x[1:] - x.mean()) * np.diff(y) - (y[1:] - y.mean()) * np.diff(x))
    scale = x.std() * np.diff(y).std() + y.std() * np.diff(x).std()
    return float(area / scale) if scale > 0 else 0.0


def _regularity(x: np.ndarray) -> float:
    """Largest autocorrelation after the first zero crossing."""
    z = x - x.mean()
    size = 1 << (2 * z.size - 1).bit_length()
    acf = np.fft.irfft(np.abs(np.fft.rfft(z, size)) ** 2, size)[: z.size // 2]
    if acf[0] <= 0:
        return 0.0
    below = np.flatnonzero(acf < 0)
    return float(acf[below[0] :].max() / acf[0]) if below.size else 0.0


def _answer_to_steps(s: Signals, scale: Scale, lag: int) -> list[float]:
    """Mean course of PV and OP after the set-point steps, per unit of step, in four windows of
    about one time scale.
    """
    times = np.flatnonzero(np.diff(s.sp)) + 1
    size = s.sp[times] - s.sp[times - 1]
    edges = [0, max(lag // 2, 1), lag + 1, 2 * lag + 2, 3 * lag + 3]
    out = []
    for x, unit in ((s.pv, 1.0), (s.op, scale.step_unit)):
        for a, b in pairwise(edges):
            moved = [
                x[t + a : t + b].mean() - x[max(t - lag, 0) : t].mean() if t + a < x.size else 0.0
                for t in times
            ]
            out.append(float(np.dot(moved, size) / np.dot(size, size) * unit))
    return out


class Cloud(NamedTuple):
    """What one simulation looks like over many seeds: mean and spread of every feature, and the
    distance of its members.
    """

    mean: np.ndarray
    spread: np.ndarray
    floor: float

    def distance(self, values: np.ndarray) -> float:
        """Return the mean over features of |value - mean| / spread, each capped."""
        return float(np.minimum(np.abs(values - self.mean) / self.spread, _CAP).mean())


def cloud(runs: Iterable[Signals], scale: Scale) -> Cloud:
    """Return centre, spread and floor of a set of runs that differ in their seeds only."""
    pairs = [features(run, scale) for run in runs]
    table = np.array([values for values, _ in pairs])
    blur = np.median([b for _, b in pairs], axis=0)
    left_out = []
    for i in range(len(table)):
        others = np.delete(table, i, axis=0)
        rest = Cloud(others.mean(0), np.hypot(others.std(0, ddof=1), blur), 0.0)
        left_out.append(rest.distance(table[i]))
    return Cloud(
        table.mean(0),
        np.hypot(table.std(0, ddof=1), blur),
        max(float(np.mean(left_out)), _LEAST_FLOOR),
    )
