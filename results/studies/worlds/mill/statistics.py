"""Phase-free statistics of one record: what a control engineer would measure, whatever the moment
at which it began.
"""

from __future__ import annotations

from functools import cache

import numpy as np

Record = dict[str, np.ndarray]
_SEGMENT = 256
_BANDS = (
    (1, 2),
    (2, 3),
    (3, 5),
    (5, 9),
    (9, 17),
    (17, 33),
    (33, 65),
    (65, 129),
)  # bins of a segment's spectrum
_CROSS = 7  # bands in which the two signals' coherency is reliable

# smallest spread granted to a statistic, by the first word of its name (sizes and powers in
# decades): about a tenth of a size, a quarter of a power, a tenth of a share, so that a visible
# effect is one that matters and not only one that can be counted
_FLOORS = {
    "power": 0.10,
    "coherency": 0.05,
    "size": 0.05,
    "kurtosis": 0.10,
    "skew": 0.10,
    "standing": 0.10,
    "distinct": 0.40,
    "slow": 0.05,
    "trend": 0.10,
    "ends": 0.02,
    "straight": 0.10,
    "peaks": 0.10,
    "longest": 0.25,
    "misfit": 0.10,
    "gain": 0.08,
    "surprise": 0.05,
    "offset": 0.10,
}


@cache
def names() -> tuple[str, ...]:
    """Return the statistics' names in the order of `measure`."""
    bands = [f"{lo}-{hi - 1}" for lo, hi in _BANDS]
    spectra = [f"power {s} {b}" for s in ("error", "op") for b in bands]
    cross = [f"coherency {part} {b}" for part in ("real", "imag") for b in bands[:_CROSS]]
    of_moves = ("size", "kurtosis", "skew", "standing", "longest", "distinct")
    of_levels = ("size", "skew", "kurtosis", "slow", "trend", "ends")
    moves = [f"{q} of {s}'s moves" for s in ("pv", "op") for q in of_moves]
    levels = [f"{q} of {s}" for s in ("error", "op") for q in of_levels]
    bends = ["size of pv's bends", "straight pv", "peaks of pv"]
    models = [
        "gain of the law: Kc",
        "gain of the law: integral",
        "misfit of the law",
        "surprise of pv",
        "offset of the error",
    ]
    return (*spectra, *cross, *moves, *levels, *bends, *models)


@cache
def floors() -> np.ndarray:
    """Return the smallest spread granted to each statistic."""
    return np.array([_FLOORS[name.split(" ")[0]] for name in names()])


def measure(record: Record, Kc: float, late: int) -> np.ndarray:
    """Return the statistics of SP, OP and PV; MV is left out, so that visibility does not depend on
    its being recorded.
    """
    pv, op = record["pv"], record["op"]
    error = record["sp"] - pv
    e, u = error - error.mean(), op - op.mean()
    power_e, power_u, cross = _spectra(e, u)
    coherency = cross[:_CROSS] / np.sqrt(power_e[:_CROSS] * power_u[:_CROSS] + 1e-300)
    bends = np.abs(np.diff(pv, 2))
    high, usual = np.quantile(bends, (0.997, 0.8))
    straight = float(np.mean(bends < 1e-6 * np.ptp(pv)))
    values = [
        _log(power_e),
        _log(power_u),
        coherency.real,
        coherency.imag,
        _moves(pv),
        _moves(op),
        _levels(e),
        _levels(u),
    ]
    values += [[_log(np.std(bends)), straight, _log(high) - _log(usual)], _law(error, op, Kc, late)]
    values.append([_surprise(pv, op), error.mean() / (np.std(e) + 1e-12)])
    return np.concatenate(values)


def _log(x: np.ndarray | float) -> np.ndarray:
    return np.log10(np.asarray(x) + 1e-12)


def _spectra(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Powers of two signals and their cross power in bands, by Welch's method with half overlapping
    Hann windows.
    """
    starts = np.arange(0, len(x) - _SEGMENT + 1, _SEGMENT // 2)
    rows = starts[:, None] + np.arange(_SEGMENT)
    window = np.hanning(_SEGMENT)
    fx, fy = np.fft.rfft(x[rows] * window), np.fft.rfft(y[rows] * window)
    both = [
        np.mean(np.abs(fx) ** 2, axis=0),
        np.mean(np.abs(fy) ** 2, axis=0),
        np.mean(fx * fy.conj(), axis=0),
    ]
    xx, yy, xy = (np.array([p[lo:hi].mean() for lo, hi in _BANDS]) for p in both)
    return xx, yy, xy


def _moments(x: np.ndarray) -> tuple[float, float, float]:
    """Size, skewness and logarithm of the kurtosis."""
    x = x - x.mean()
    size = float(np.std(x)) + 1e-15
    z = x / size
    return float(_log(size)), float(np.mean(z**3)), float(_log(np.mean(z**4)))


def _moves(x: np.ndarray) -> list[float]:
    step = np.diff(x)
    size, skew, kurtosis = _moments(step)
    at_rest = step == 0.0
    runs = np.diff(np.flatnonzero(np.concatenate([[True], ~at_rest, [True]]))) - 1
    distinct = len(np.unique(x)) / len(x)
    return [
        size,
        kurtosis,
        skew,
        float(at_rest.mean()),
        float(np.log10(1.0 + runs.max())),
        float(np.log10(distinct)),
    ]


def _levels(x: np.ndarray) -> list[float]:
    size, skew, kurtosis = _moments(x)
    means = np.array([part.mean() for part in np.array_split(x, 8)])
    time = np.linspace(-1.0, 1.0, len(x))
    trend = np.mean(x * time) / (np.std(x) * np.std(time) + 1e-15)
    near = 0.01 * np.ptp(x)
    ends = np.mean((x < x.min() + near) | (x > x.max() - near))
    return [size, skew, kurtosis, float(_log(np.std(means))), float(trend), float(ends)]


def _law(error: np.ndarray, op: np.ndarray, Kc: float, late: int) -> list[float]:
    """Gains of the PI law fitted to the record, over Kc, and the share of OP's moves that it
    leaves.
    """
    n = len(error) - late
    e, moves = error[:n], np.diff(op[late:])
    before = np.column_stack([np.diff(e), e[:-1], np.ones(n - 1)])
    coefficients, left = _least_squares(before, moves)
    return [
        coefficients[0] / Kc,
        coefficients[1] / Kc,
        float(np.std(left) / (np.std(moves) + 1e-12)),
    ]


def _surprise(pv: np.ndarray, op: np.ndarray) -> float:
    """Size of what the past of PV and OP do not foretell one sample ahead."""
    past = [1, 2, 3]
    k = np.arange(8, len(pv))
    x = pv - pv.mean()
    u = op - op.mean()
    table = np.column_stack([x[k - i] for i in past] + [u[k - i] for i in (1, 2, 4, 8)])
    return float(_log(np.std(_least_squares(table, x[k])[1])))


def _least_squares(table: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and what they leave, by the normal equations of scaled columns, kept solvable by
    a small diagonal.
    """
    scale = np.sqrt(np.mean(table**2, axis=0)) + 1e-15
    a = table / scale
    gram = a.T @ a / len(y) + 1e-10 * np.eye(a.shape[1])
    solution = np.linalg.solve(gram, a.T @ y / len(y)) / scale
    return solution, y - table @ solution
