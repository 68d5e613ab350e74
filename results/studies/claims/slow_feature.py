"""The Hurst exponent of the slowest feature of OP and PV.

Slow features: of stacked lags of both signals, whitened, the direction whose values change least
from sample to sample. A sticking valve is said to make that feature more persistent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import spearmanr

from results.studies.claims.judged import (
    Claim,
    Loops,
    counted,
    learned_threshold,
)  # fmt: skip
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord

LAGS = (2, 10)  # samples stacked; the abstract states none
_THIN = 1e-9  # share of the variance below which a direction is left out: OP repeats PV there
_SCALES = 12  # window lengths over which the exponent is fitted
_SHORTEST = 8  # samples of a window


def slowest(record: LoopRecord, lags: int) -> np.ndarray:
    """Return the slowest feature of so many lags of OP and PV, of variance 1."""
    both = np.array([record.op, record.pv])
    both = (both - both.mean(axis=1, keepdims=True)) / (both.std(axis=1, keepdims=True) + 1e-12)
    n = both.shape[1] - lags
    stacked = np.concatenate([both[:, k : k + n] for k in range(lags + 1)])
    stacked -= stacked.mean(axis=1, keepdims=True)
    variance, turn = np.linalg.eigh(np.cov(stacked))
    kept = variance > _THIN * variance[-1]
    white = (turn[:, kept] / np.sqrt(variance[kept])).T @ stacked
    _, directions = np.linalg.eigh(np.cov(np.diff(white)))
    return directions[:, 0] @ white


def windows(n: int) -> np.ndarray:
    """Return the lengths of windows, evenly apart on a logarithmic scale, up to a quarter of the
    signal.
    """
    return np.unique(np.geomspace(_SHORTEST, max(n // 4, _SHORTEST + 1), _SCALES).astype(int))


def rescaled_range(x: np.ndarray) -> float:
    """Return the Hurst exponent by the rescaled range: range of the cumulated deviations over the
    standard deviation, over the length of the window.
    """
    means = []
    for w in windows(x.size):
        pieces = x[: x.size // w * w].reshape(-1, w)
        path = np.cumsum(pieces - pieces.mean(axis=1, keepdims=True), axis=1)
        spread = pieces.std(axis=1)
        moved = spread > 0.0
        means.append(np.mean(np.ptp(path, axis=1)[moved] / spread[moved]) if moved.any() else 1.0)
    return float(np.polyfit(np.log(windows(x.size)), np.log(means), 1)[0])


def fluctuation(x: np.ndarray) -> float:
    """Return the exponent of detrended fluctuation analysis: scatter of the cumulated signal about
    a line, over the length of the window.
    """
    path, scatter = np.cumsum(x - x.mean()), []
    for w in windows(x.size):
        pieces, t = path[: path.size // w * w].reshape(-1, w), np.arange(w) - 0.5 * (w - 1)
        level = pieces - pieces.mean(axis=1, keepdims=True)
        scatter.append(np.sqrt(np.mean((level - np.outer(level @ t / (t @ t), t)) ** 2)))
    return float(np.polyfit(np.log(windows(x.size)), np.log(np.maximum(scatter, 1e-12)), 1)[0])


def samples_per_period(record: LoopRecord) -> float:
    """Return the rhythm of a loop; NaN where it does not oscillate."""
    oscillation = prepare(record).oscillation
    return oscillation.period_s / record.Ts if oscillation.sustained else float("nan")


def rows(data: Sequence[Loops]) -> list[tuple[str, ...]]:
    """Return a line for each exponent and number of lags, one for the rhythm alone, and how far the
    rhythm explains the exponent.
    """
    exponents: dict[str, Callable[[np.ndarray], float]] = {
        "rescaled range": rescaled_range,
        "fluctuation": fluctuation,
    }
    table = []
    for loops in data:
        rhythm = np.log([samples_per_period(record) for record in loops.records])
        for lags in LAGS:
            features = [slowest(record, lags) for record in loops.records]
            for name, exponent in exponents.items():
                h = np.array([exponent(x) for x in features])
                table.append(counted(f"{name}, {lags} lags", loops, learned_threshold(h, loops)))
                table.append(_explained(loops, h, rhythm))
        table.append(counted("log samples per period", loops, learned_threshold(rhythm, loops)))
    return table


def _explained(loops: Loops, h: np.ndarray, rhythm: np.ndarray) -> tuple[str, ...]:
    """Return the line of what is left of an index once a line over the logarithm of the samples per
    period is taken off.
    """
    known = np.isfinite(rhythm)
    left = np.full(h.size, np.nan)
    left[known] = h[known] - np.polyval(np.polyfit(rhythm[known], h[known], 1), rhythm[known])
    rank = spearmanr(h[known], rhythm[known]).statistic
    what = f"  without rhythm (rank correlation {rank:.2f})"
    return counted(what, loops, learned_threshold(left, loops))


CLAIM = Claim(
    claimed=(
        "an index made of the Hurst exponent of the slowest dynamic feature of OP and PV detects"
        " stiction on simulations and actual cases; L. Shang, Y. Zhang, H. Zhang (2023), Processes"
        " 11, 1913 (abstract: effectively, without a figure)"
    ),
    protocol=(
        "whole record, both signals standardised; the threshold is learned on all other"
        " contributors, or pairs; larger exponents mean stiction"
    ),
    stand_in=(
        "number of lags, kind of exponent and the threshold of the index, which the abstract does"
        " not state"
    ),
    rows=rows,
)
