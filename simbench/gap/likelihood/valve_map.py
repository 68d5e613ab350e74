"""The valve judged by MV given OP alone: which map of the vocabulary, with which numbers, turns one into the other."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import size_penalty

HEALTHY = 1.0  # % of travel: dead-band that a healthy valve may have; friction below it is no effect
PEAKS = 4  # of the best points of a grid over valve maps that are refined


def valve_against_mv(op: np.ndarray, mv: np.ndarray, Ts: float) -> dict[str, tuple[float, dict[str, float | str]]]:
    """Return nats over an ideal valve, and parameters, of each valve effect as a map from OP to MV.

    Parameters
    ----------
    op, mv : ndarray, shape (n,)
        In %.
    Ts : float
        Sampling period (s).

    Returns
    -------
    dict of str to (float, dict)
    """
    n = op.size
    span = float(np.ptp(op)) or 1.0
    fine = (1e-3 * span) ** 2  # below a thousandth of the range nobody's valve is known

    def level(v: np.ndarray) -> float:
        return 0.5 * n * np.log(float(np.mean((mv - v) ** 2)) + fine)

    ideal = healthy_level(op, mv)
    sizes = np.geomspace(0.02 * span, 1.5 * span, 50)
    out: dict[str, tuple[float, dict[str, float | str]]] = {}

    def best(trials: list[tuple[float, dict[str, float | str]]], count: float) -> tuple[float, dict[str, float | str]]:
        value, p = min(trials, key=lambda t: t[0])
        return max(float(ideal - value - size_penalty(n, count)), -20.0), p

    def maps(kind: int, p0: float, p1: float) -> np.ndarray:
        first = mv[0] - op[0] if kind in (kernels.PLAY, kernels.STICK, kernels.CREEP) else 0.0
        if kind == kernels.PLAY:
            return kernels.valve(op, kind, p0, first, 0.0)
        return kernels.valve(op, kind, p0, p1, first)

    def zoom(
        kind: int, names: tuple[str, str], grid: list[tuple[float, float]], count: float
    ) -> tuple[float, dict[str, float | str]]:
        def tried(points: list[tuple[float, float]]) -> list[tuple[float, float, float]]:
            return sorted((level(maps(kind, a, b)), a, b) for a, b in points)

        found = []
        # peaks are narrow and of several depths: follow the best few down
        for _, a, b in tried(grid)[:PEAKS]:
            for share in (0.1, 0.05, 0.02, 0.01, 0.004, 0.001):
                wide = a if kind == kernels.ZONE else b
                near = [
                    (a * (1 + i * share / 2), b + j * share * wide)
                    for i in (-2, -1, 0, 1, 2)
                    for j in ((-2, -1, 0, 1, 2) if b else (0,))
                ]
                value, a, b = tried(near)[0]
            found.append((value, a, b))
        value, a, b = min(found)
        p: dict[str, float | str] = {names[0]: float(a)}
        if names[1]:
            p[names[1]] = float(b)
        return best([(value, p)], count)

    grid = [(s, s * j) for s in sizes for j in (0.05, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)]
    stick = max((zoom(k, ("S", "J"), grid, 2.0) for k in (kernels.STICK, kernels.CREEP)), key=lambda t: t[0])
    out["stiction"] = stick
    out["deadband"] = zoom(kernels.PLAY, ("S", ""), [(s, 0.0) for s in sizes], 1.0)
    out["deadzone"] = zoom(
        kernels.ZONE, ("D", "c"), [(s, c) for s in sizes for c in np.quantile(op, np.linspace(0.05, 0.95, 13))], 2.0
    )
    out["valve_characteristic"] = zoom(
        kernels.CURVE, ("R", ""), [(r, 0.0) for r in (*np.geomspace(0.01, 0.8, 12), *np.geomspace(1.25, 100, 12))], 1.0
    )
    lags = [(level(lagged(op, tau)), {"tau": float(tau * Ts)}) for tau in np.geomspace(0.2, n / 10, 120)]
    out["valve_lag"] = best(lags, 1.0)
    return out


def healthy_level(op: np.ndarray, mv: np.ndarray) -> float:
    """Return n log(rms of MV less its model) for a valve without effect: ideal, or with a healthy valve's play.

    Parameters
    ----------
    op, mv : ndarray, shape (n,)
        In %.

    Returns
    -------
    float
    """
    fine = (1e-3 * (float(np.ptp(op)) or 1.0)) ** 2
    tries = [np.clip(op, 0.0, 100.0)]
    tries += [kernels.valve(op, kernels.PLAY, s, mv[0] - op[0], 0.0) for s in np.linspace(0.05, 1.0, 20) * HEALTHY]
    return min(0.5 * op.size * float(np.log(np.mean((mv - v) ** 2) + fine)) for v in tries)


def lagged(op: np.ndarray, tau: float) -> np.ndarray:
    """Return a signal behind a first-order lag of `tau` samples, begun at rest.

    Parameters
    ----------
    op : ndarray, shape (n,)
    tau : float
        In samples.

    Returns
    -------
    ndarray, shape (n,)
    """
    a = np.exp(-1.0 / tau)
    return op[0] + lfilter([1.0 - a], [1.0, -a], op - op[0])
