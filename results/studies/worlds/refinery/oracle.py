"""How visible is an effect? The ratio of two distances to the cloud of records of the same loop
without it.

A record is described by statistics of SP - PV, OP and PV that do not depend on phase: sizes,
spectra, shapes of the distributions, correlations, regularity, slow movement, and single-sample
signs (repeated values, straight stretches, lone spikes). MV is left out, so that an effect is as
large where MV is recorded as where it is not. The distance of a record is the largest, over the
groups of statistics, of the root mean square of its standardised deviations from the cloud's mean.
The ratio is the mean distance of records with the effect over the mean distance of each of the
cloud's records from the others: ordinary loads and noise of the same family are in both, so an
effect counts only as far as it exceeds them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.fft import rfft

BANDS = {"weak": (1.3, 2.0), "medium": (2.0, 4.0), "strong": (4.0, 12.0)}
_LOG = 0.05  # smallest scatter granted to a logarithm: 5 % in a size is nobody's finding
SHARE = 0.02  # ... and to a share of samples or a correlation


def _log(x: float) -> float:
    return float(np.log(max(x, 1e-12)))


def _shape(x: np.ndarray) -> list[float]:
    """Tail, skew and time asymmetry by quantiles."""
    q = np.quantile(x, [0.005, 0.05, 0.5, 0.95, 0.995])
    width = max(q[3] - q[1], 1e-12)
    return [(q[4] - q[0]) / width / 4.0, (q[3] + q[1] - 2.0 * q[2]) / width]


def _spectrum(x: np.ndarray) -> tuple[list[float], list[float]]:
    """Log power in eight bands, and the sharpest line: its share of the power and its frequency."""
    n = x.size
    # the trend between the ends would leak into every band
    line = x - np.linspace(x[: n // 50].mean(), x[-(n // 50) :].mean(), n)
    power = np.abs(rfft((line - line.mean()) * np.hanning(n))) ** 2
    edges = np.unique(np.geomspace(3, power.size, 9).astype(int))
    bands = [_log(float(power[a:b].sum()) / n) for a, b in pairwise(edges)]
    total = max(float(power[3:].sum()), 1e-300)
    smooth = np.convolve(power[3:], np.ones(5), "same")
    peak = int(np.argmax(smooth))
    return bands, [_log(float(smooth[peak]) / total), _log(peak + 3.0)]


def _correlations(x: np.ndarray, y: np.ndarray, lags: tuple[int, ...]) -> list[float]:
    x, y = x - x.mean(), y - y.mean()
    size = max(float(np.sqrt(x @ x) * np.sqrt(y @ y)), 1e-300)
    return [float(x[: x.size - k] @ y[k:]) / size for k in lags]


def _slow(x: np.ndarray) -> list[float]:
    """How far the means of tenths of the record lie apart, and how far the last third from the
    first.
    """
    means = np.array([part.mean() for part in np.array_split(x, 10)])
    spread = max(float(np.std(x)), 1e-12)
    return [
        _log(float(np.std(means)) / spread),
        abs(float(means[7:].mean() - means[:3].mean())) / spread * 0.2,
    ]


def _samples(x: np.ndarray) -> list[float]:
    """Repeats, straight stretches, lone spikes, samples at either end of the range."""
    d = np.diff(x)
    size = max(float(np.std(d)), 1e-12)
    still = np.abs(d) < 1e-6 * size
    straight = (np.abs(np.diff(d)) < 0.02 * size) & ~still[1:]
    middle = np.abs(
        x[1:-1]
        - np.maximum(np.minimum(x[:-2], x[2:]), np.minimum(np.maximum(x[:-2], x[2:]), x[1:-1]))
    )
    scale = max(
        float(np.median(middle[middle > 0.0])) if np.any(middle > 0.0) else 0.0, 1e-9 * size
    )
    span = max(float(np.ptp(x)), 1e-12)
    ends = [float(np.mean(x > x.max() - 1e-6 * span)), float(np.mean(x < x.min() + 1e-6 * span))]
    lone = [10.0 * float(np.mean(middle > 8.0 * scale)), 0.1 * _log(float(middle.max()) / scale)]
    return [float(still.mean()), float(straight.mean()), *lone, *ends]


def features(record: dict[str, np.ndarray], time: float) -> list[np.ndarray]:
    """Return the groups of statistics of one record."""
    e, op, pv = record["sp"] - record["pv"], record["op"], record["pv"]
    lags = tuple(sorted({max(1, min(round(time * f), e.size // 4)) for f in (0.15, 0.5, 1.5, 4.0)}))
    differences = [np.diff(e), np.diff(op), np.diff(e, 2), np.diff(op, 2)]
    e_bands, e_line = _spectrum(e)
    op_bands, op_line = _spectrum(op)
    shapes = [v for x in (e, op, *differences[:2]) for v in _shape(x)]
    correlation = (
        _correlations(e, e, lags) + _correlations(op, op, lags) + _correlations(e, op, (0, *lags))
    )
    groups = [
        (np.array([_log(float(np.std(x))) for x in (e, op, *differences)]), _LOG),
        (np.array(e_bands), 2 * _LOG),
        (np.array(op_bands), 2 * _LOG),
        (np.array(e_line), 2 * _LOG),
        (np.array(op_line), 2 * _LOG),
        (np.array(shapes), SHARE),
        (np.array(correlation), SHARE),
        (np.array(_slow(e) + _slow(op)), 2 * _LOG),
        (np.array(_samples(pv)), SHARE),
        (np.array(_samples(op)), SHARE),
    ]
    return [x / floor for x, floor in groups]


class Cloud:
    """The records of one loop without the effect, as the place from which distances are taken."""

    def __init__(self, members: list[list[np.ndarray]]) -> None:
        self._groups = [np.array(group) for group in zip(*members)]
        count = len(members)
        distances = [
            self._distance([g[i] for g in self._groups], np.arange(count) != i)
            for i in range(count)
        ]
        # mean distance of a record without the effect from the others
        self.spread = float(np.mean(distances))

    def _distance(self, record: list[np.ndarray], keep: np.ndarray) -> float:
        worst = 0.0
        for group, x in zip(self._groups, record):
            part = group[keep]
            # one unit of smallest scatter is added in quadrature
            z = (x - part.mean(axis=0)) / np.sqrt(part.var(axis=0, ddof=1) + 1.0)
            worst = max(worst, float(np.sqrt(np.mean(np.minimum(z * z, 1e6)))))
        return worst

    def ratio(self, records: list[list[np.ndarray]]) -> float:
        """Return the mean distance of `records` (their features) in units of the cloud's
        spread.
        """
        every = np.ones(len(self._groups[0]), dtype=bool)
        return float(np.mean([self._distance(r, every) for r in records])) / self.spread
