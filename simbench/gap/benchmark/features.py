"""Describe a record by numbers that have no unit, each of one block of the loop, so that records of
loops of any size and speed can be compared.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.conditioning import median
from simbench.detectors.signal.filters import lfilter

BLOCKS = (
    "length",
    "samples per period",
    "noise",
    "lattice",
    "set point",
    "load",
    "controller",
    "valve",
)
# added to shares whose logarithm is a feature: of power and variance, of samples
_POWER = 1e-3
_SHARE = 0.01
_SMALLEST = 1e-12
# std of white noise over the median of its absolute fourth difference, as in `no_waveform`
_NOISE_SCALE = 1.0 / (0.6745 * 70.0**0.5)
# edges of the bands of the error's spectrum, in its median frequency
_EDGES = (0.0, 0.25, 0.5, 0.8, 1.25, 2.0, 4.0)
# time constants and dead times (samples) of what OP is passed through to explain PV
_LAGS = (0, 2, 6, 20, 60)
_DELAYS = (1, 4, 12)
_PULL = 1e-4  # ridge of that regression, in variances
_MEANS = 20  # means of OP and PV per period, whose changes have the shape of a wave and no noise
_LARGEST = 1e3  # factor up to which a quotient counts


def describe(record: LoopRecord) -> dict[tuple[str, str], float]:
    """Return the features of a record, each with its block and its name."""
    op = np.asarray(record.op, float)
    pv = np.asarray(record.pv, float)
    sp = np.full(record.n, pv.mean()) if record.sp is None else np.asarray(record.sp, float)
    fits = _explained_share(op, pv)
    pace = _median_frequency(op - op.mean())
    found = {
        **_name_features("length", _length(op, pace)),
        **_name_features("samples per period", _pace(sp - pv, pace)),
        **_name_features("noise", _noise(sp - pv, fits)),
        **_name_features("lattice", _lattice(op, pv)),
        **_name_features("set point", _set_point(sp, pv)),
        **_name_features("load", _load(sp - pv, pv, fits)),
        **_name_features("controller", _controller(op, sp - pv, pace)),
        **_name_features("valve", _valve(op, pv, pace)),
    }
    return {name: value if np.isfinite(value) else 0.0 for name, value in found.items()}


def samples_per_period(record: LoopRecord) -> float:
    """Return the samples of a period at the median frequency of OP."""
    op = np.asarray(record.op, float)
    return 1.0 / _median_frequency(op - op.mean())


def _name_features(block: str, values: dict[str, Any]) -> dict[tuple[str, str], float]:
    return {(block, name): float(value) for name, value in values.items()}


def _spectrum(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (1/sample) above 0 and the power of a signal at them."""
    power = np.abs(np.fft.rfft(x * np.hanning(x.size))) ** 2
    return np.arange(1, power.size) / x.size, power[1:]


def _median_frequency(x: np.ndarray) -> float:
    """Return the frequency (1/sample) below which half of a signal's power lies."""
    frequency, power = _spectrum(x)
    total = np.cumsum(power)
    if not total[-1] > 0.0:
        return 1.0 / x.size
    return float(frequency[np.searchsorted(total, 0.5 * total[-1])])


def _length(op: np.ndarray, pace: float) -> dict[str, Any]:
    return {"samples": np.log(op.size), "periods": np.log(op.size * pace)}


def _pace(error: np.ndarray, pace: float) -> dict[str, Any]:
    return {"OP": -np.log(pace), "error": -np.log(_median_frequency(error - error.mean()))}


def _noise(error: np.ndarray, fits: np.ndarray) -> dict[str, Any]:
    """Return what the fast part of the error says: its size against what OP does to PV, its tails
    and its colour.
    """
    second = np.diff(error, 2)
    power = float(np.mean(second**2)) + _SMALLEST**2
    level = _NOISE_SCALE * median(np.abs(np.diff(error, 4)))
    return {
        "level": np.log(_POWER + level / (np.std(fits) + _SMALLEST)),
        "tails": np.log1p(np.mean(second**4) / power**2),
        "colour": np.mean(second[1:] * second[:-1]) / power,
    }


def _lattice(op: np.ndarray, pv: np.ndarray) -> dict[str, Any]:
    """Return how often values repeat, how many there are, and how often three lie on a line."""
    out = {}
    for name, x in (("OP", op), ("PV", pv)):
        moves = np.diff(x)
        straight = (np.abs(np.diff(moves)) < 1e-6 * np.std(x)) & (moves[1:] != 0.0)
        out[f"{name} repeats"] = np.log(_SHARE + np.mean(moves == 0.0))
        out[f"{name} values"] = np.log(_SHARE + np.unique(x).size / x.size)
        out[f"{name} straight"] = np.log(_SHARE + np.mean(straight))
    return out


def _set_point(sp: np.ndarray, pv: np.ndarray) -> dict[str, Any]:
    return {
        "moves": np.log(_POWER + np.mean(np.diff(sp) != 0.0)),
        "size": np.log(_SHARE + np.std(sp) / (np.std(pv) + _SMALLEST)),
    }


def _load(error: np.ndarray, pv: np.ndarray, fits: np.ndarray) -> dict[str, float]:
    """Return the shape of the error's spectrum about its median frequency, and what OP does not
    explain of PV.
    """
    frequency, power = _spectrum(error - error.mean())
    about = frequency / _median_frequency(error - error.mean())
    total = float(power.sum()) + _SMALLEST
    out = {
        f"power from {a} to {b} of its median frequency": np.log(
            _POWER + power[(about > a) & (about <= b)].sum() / total
        )
        for a, b in pairwise(_EDGES)
    }
    left = pv - pv.mean() - fits
    sizes = [float(np.std(part)) for part in np.array_split(error, 6)]
    return out | {
        "sharpness": np.log(_POWER + np.sort(power)[-3:].sum() / total),
        "changes of size": np.log(
            (max(sizes) + _SMALLEST) / (min(sizes) + _POWER * max(sizes) + _SMALLEST)
        ),
        "unexplained by OP": np.log(_POWER + np.std(left) / (np.std(pv) + _SMALLEST)),
        "colour of that": np.mean(left[1:] * left[:-1]) / (np.var(left) + _SMALLEST),
    }


def _explained_share(op: np.ndarray, pv: np.ndarray) -> np.ndarray:
    """Return what of PV, about its mean, a regression on delayed and lagged OP explains."""
    u = op - op.mean()
    n = op.size
    columns = [np.arange(n) / n, np.cumsum(u) / n]
    for lag in _LAGS:
        pole = np.exp(-1.0 / lag) if lag else 0.0
        slowed = np.asarray(lfilter([1.0 - pole], [1.0, -pole], u))
        for delay in (d for d in _DELAYS if d < n):
            columns.append(np.append(np.zeros(delay), slowed[: n - delay]))
    X = np.column_stack(columns)
    X = (X - X.mean(axis=0)) / (X.std(axis=0) + _SMALLEST)
    gram = X.T @ X / n + _PULL * np.eye(X.shape[1])
    return X @ np.linalg.solve(gram, X.T @ (pv - pv.mean()) / n)


def _controller(op: np.ndarray, error: np.ndarray, pace: float) -> dict[str, float]:
    """Return how far OP's moves follow a PI law of the error, what a derivative adds, and how fast
    the law is.
    """
    moves = np.diff(op)[1:]
    change = np.diff(error)
    pi = np.column_stack([change[1:], error[2:], np.ones(op.size - 2)])
    law, left = _regress(pi, moves)
    _, less = _regress(np.column_stack([pi, np.diff(change)]), moves)
    gain = abs(law[0])
    ends = (op == op.max()) | (op == op.min())
    return {
        "left by a PI law": np.log(_POWER**2 + left),
        "told by a derivative": np.log(_POWER + (left - less) / (left + _POWER**2)),
        "gain": _log_within(gain * np.std(error) / (np.std(op) + _SMALLEST)),
        "integral action": _log_within(abs(law[1]) / (gain + _SMALLEST) / pace),
        "at its ends": np.log(_SHARE + np.mean(ends)),
    }


def _regress(X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Return a least-squares fit, and the share of the variance that it leaves."""
    fit = np.linalg.lstsq(X, y, rcond=None)[0]
    return fit, float(np.var(y - X @ fit) / (np.var(y) + _SMALLEST**2))


def _log_within(x: float) -> float:
    return float(np.log(np.clip(x, 1.0 / _LARGEST, _LARGEST)))


def _valve(op: np.ndarray, pv: np.ndarray, pace: float) -> dict[str, float]:
    """Return the shape of the waves of OP and PV: kurtosis and skewness of them, and of the changes
    of their means over a twentieth of a period.
    """
    size = max(round(1.0 / (_MEANS * pace)), 1)
    whole = op.size // size * size
    out = {}
    for name, x in (("OP", op), ("PV", pv)):
        z = (x - x.mean()) / (np.std(x) + _SMALLEST)
        step = np.diff(x[:whole].reshape(-1, size).mean(axis=1))
        step = step / (np.sqrt(np.mean(step**2)) + _SMALLEST) if step.size else np.zeros(1)
        out[f"{name} kurtosis"] = np.log(_POWER + np.mean(z**4))
        out[f"{name} skewness"] = abs(float(np.mean(z**3)))
        out[f"{name} change kurtosis"] = np.log1p(np.mean(step**4))
        out[f"{name} change skewness"] = abs(float(np.mean(step**3)))
    return out
