"""Hammerstein identification: the (S, J) valve and the linear plant behind it that best turn OP into PV."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from detectors.signal.hammerstein_kernels import MOVING_UP, compiled
from detectors.signal.oscillation import detrend

SAMPLES = 50  # per period at least, of valve position and PV after averaging
# Periods and averaged samples looked at: the search wants few, since one missed jump spoils all that follow; the end, many.
SHORT, FULL = (8, 360), (24, 700)
TIMES = np.array([0.01, 0.04, 0.1, 0.25, 0.7])  # time constants tried, in periods; an integrator besides
S_SHARES = np.concatenate([np.geomspace(0.04, 0.55, 6), np.linspace(0.64, 1.0, 10)])  # of the swing of OP
J_SHARES = np.array([0.05, 0.35, 0.8, 1.3])  # of S
S_FINE = np.concatenate([np.geomspace(0.04, 0.45, 8), np.linspace(0.48, 1.0, 27)])
J_FINE = np.array([0.03, 0.15, 0.25, 0.35, 0.45, 0.6, 0.75, 0.9, 1.0, 1.1, 1.25, 1.4])
J_PROFILE = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.25)  # of S
ENOUGH = 2e-4  # share of the variance of PV below which errors say nothing: sampling, rounding
PASSES, TOP = 2, 4  # of the dense grid, each with the best plant so far; candidates kept
STARTS = (0.0, -0.5, 0.5)  # rest positions tried, as shares of the break-away band
AROUND = np.array([1.0, 0.5, 0.63, 0.79, 1.0, 1.26, 1.59, 2.0])  # times the inverse of a time constant


@dataclass(frozen=True)
class Hammerstein:
    """A sticky valve and a first-order or integrating plant that turn OP into PV.

    Parameters
    ----------
    S, J : float
        Of the best model, in the unit of OP.
    S_range, J_range : (float, float)
        Values whose best error is within the tolerance of the smallest one.
    error, error_linear : float
        Mean squared error over the variance of PV, with the best valve and with S = J = 0; drift left out of both.
    sign : float
        Of the plant's gain, +1 or -1.
    T_s, Td_s : float
        Time constant (s; inf = integrating) and dead time (s) of the best model.
    """

    S: float
    J: float
    S_range: tuple[float, float]
    J_range: tuple[float, float]
    error: float
    error_linear: float
    sign: float
    T_s: float
    Td_s: float


class _Search:
    """One record made ready, and the kernels with its arguments filled in."""

    def __init__(
        self, op: np.ndarray, pv: np.ndarray, period: float, limits: tuple[float, float], reach: tuple[int, int]
    ) -> None:
        self.q = q = max(1, int(period / SAMPLES))
        self.period = period / q
        start, stop = strongest_segment(op, period, min(op.size, int(reach[0] * period), reach[1] * q))
        # from the highest OP of the first cycle on: there a cycling valve has just been moving up
        start += int(np.argmax(op[start : start + max(min(round(period), (stop - start) // 4), 1)]))
        n = (stop - start) // q
        self.op = np.ascontiguousarray(op[start : start + n * q])
        y = pv[start : start + n * q].reshape(n, q).mean(axis=1)
        half = max(round(self.period / 2), 1)
        # the valve of one sample acts on PV in the next; after averaging, within the same
        least = 1 if q == 1 else 0
        self.delays = np.arange(least, least + max(round(0.6 * self.period), 2))
        first = min(round(0.3 * n), round(2.5 * self.period)) + int(self.delays[-1]) + 1
        # a controller lowers OP when PV rises if the plant's gain is positive
        self.sign = 1.0 if np.diff(op[start:stop]) @ np.diff(pv[start:stop]) < 0 else -1.0
        self.swing = swing(self.op, period) or float(np.ptp(self.op)) or 1.0
        self.cycles = (n - first - half) / self.period
        self.common = (self.op, y - moving_mean(y, half), q, half, first, n - half, self.sign, *(float(x) for x in limits))

    def poles(self, times: np.ndarray) -> np.ndarray:
        """Poles of time constants given in periods."""
        return np.exp(-1.0 / np.maximum(times * self.period, 1e-3))

    def scan(self, S, J, start: float, poles: np.ndarray, delays: np.ndarray) -> np.ndarray:
        """Error, pole index and delay index of every valve, shape (m, 3)."""
        out = np.empty((len(S), 3))
        S, J = np.asarray(S, dtype=float), np.asarray(J, dtype=float)
        compiled("scan")(*self.common, S, J, start, poles, delays, out)
        return out

    def descend(self, S, J, pole, start: float, delays: np.ndarray, width: float, least: float, fixed_J: bool = False):
        """Error, S, J and pole at the bottom of the valley, steps from `width` down to `least` shares of the swing."""
        point = np.array([S, J, np.log(-np.log(pole)) if 0.0 < pole < 1.0 else -np.inf])
        steps = width * np.array([self.swing, 0.0 if fixed_J else self.swing, 2.0 if np.isfinite(point[2]) else 0.0])
        error = compiled("descend")(*self.common, point, start, delays, steps, least / width)
        return float(error), float(point[0]), float(point[1]), float(np.exp(-np.exp(point[2])))


def fit_hammerstein(
    op: np.ndarray, pv: np.ndarray, period: float, integrating: bool = False, limits=(0.0, 100.0), Ts: float = 1.0
) -> Hammerstein:
    """Find the valve's S and J and the plant behind it from OP and PV.

    Parameters
    ----------
    op : ndarray, shape (n,)
        Controller output, % of travel with the default limits.
    pv : ndarray, shape (n,)
        Process variable, any unit.
    period : float
        Period of the oscillation in samples.
    integrating : bool
        Whether the plant integrates; else time constants and, for slow plants, an integrator are tried.
    limits : (float, float)
        Ends of travel.
    Ts : float
        Sampling period (s).

    Returns
    -------
    Hammerstein

    Notes
    -----
    Source: Srinivasan, Rengaswamy, Narasimhan & Miller (2005), Ind. Eng. Chem. Res. 44, 6719-6728, and Jelali (2008), J.
    Process Control 18, 632-642: for every (S, J) of a grid the valve model turns OP into MV, the linear part is fitted in
    closed form, and the smallest error wins. Here the linear part is an output-error model (time constant and dead time
    from a grid, gain by least squares): its error is not blurred by noise on PV as that of an ARX model is. The unknown
    state of the valve at the start is searched with the rest. In the regime where the valve only toggles between two
    positions J and the plant's gain trade off: `J_range` is then wide.
    Not for loops whose PV is moved by disturbances more than by the valve: `error` is then large.

    Examples
    --------
    >>> from detectors.signal import stiction_map
    >>> x, integral, valve, op, pv, mv = 0.0, 4.0, stiction_map.start(50.0), [], [], [50.0, 50.0]
    >>> for _ in range(1500):
    ...     integral -= 0.1 * x
    ...     op.append(50 + integral - x)
    ...     pv.append(x)
    ...     valve = stiction_map.step(op[-1], valve, 5.0, 2.0)
    ...     mv.append(valve[0])
    ...     x += 0.1 * (mv[-3] - 50 - x)
    >>> round(fit_hammerstein(np.array(op), np.array(pv), 90.0).S, 1)
    5.0
    """
    short, full = (_Search(op, pv, period, limits, reach) for reach in (SHORT, FULL))
    delays = full.delays
    poles = np.array([1.0]) if integrating else np.append(full.poles(TIMES), 1.0)
    linear = float(full.scan([0.0], [0.0], MOVING_UP, poles, delays)[0, 0])
    S, J = _grid(S_SHARES * full.swing, J_SHARES)
    some = delays[:: max(1, delays.size // 8)]
    tried = short.scan(S, J, MOVING_UP, poles, some)
    ends = []
    for i in _distinct(tried[:, 0], S, J, 4):
        d = int(np.searchsorted(delays, some[int(tried[i, 2])]))
        ends.append(_plant(short, S[i], J[i], MOVING_UP, poles[int(tried[i, 1])], d, integrating))
    # noise on OP cuts valleys of 1 % of S: a dense grid with a good plant finds them, a descent does not
    S, J = _grid(S_FINE * full.swing, J_FINE)
    for _ in range(PASSES):
        _, _, _, _, pole, d = min(ends)
        tried = short.scan(S, J, MOVING_UP, np.array([pole]), delays[max(d - 1, 0) : d + 2])
        more = [(float(tried[i, 0]), S[i], J[i], MOVING_UP, pole, d) for i in _distinct(tried[:, 0], S, J, 4)]
        ends = [_settle(short, end, integrating, (0.006,)) for end in sorted(ends + more)[:TOP]]
    ends = sorted(_plant(full, *_start(full, end), integrating) for end in ends)[:2]
    error, S_hat, J_hat, start, pole, d = min(_settle(full, end, integrating, (0.004, 0.001)) for end in ends)
    S_range, J_range = _ranges(short, (error, S_hat, J_hat, start, pole, d))
    T = np.inf if pole == 1.0 else -full.q * Ts / np.log(pole)
    dead = (delays[d] - delays[0]) * full.q * Ts
    return Hammerstein(S_hat, J_hat, S_range, J_range, error, linear, full.sign, float(T), float(dead))


def _grid(S: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """S and J of every combination."""
    return np.repeat(S, shares.size), (S[:, None] * shares).ravel()


def _distinct(errors: np.ndarray, S: np.ndarray, J: np.ndarray, count: int) -> list[int]:
    """Indices of the best candidates that are not next to a better one."""
    kept: list[int] = []
    for i in np.argsort(errors):
        if all(abs(np.log(S[i] / S[k])) > 0.1 or abs(J[i] / S[i] - J[k] / S[k]) > 0.4 for k in kept):
            kept.append(int(i))
        if len(kept) == count:
            break
    return kept


def _plant(search: _Search, S: float, J: float, start: float, pole: float, d: int, integrating: bool):
    """Improve the plant behind one valve; returns (error, S, J, start, pole, delay index)."""
    fine = np.array([pole])
    if not integrating:  # time constants around the present one
        fine = np.exp(np.log(min(max(pole, 1e-9), 0.9999)) * AROUND)
        fine[0] = pole
    found = search.scan([S], [J], start, fine, search.delays)[0]
    return float(found[0]), S, J, start, float(fine[int(found[1])]), int(found[2])


def _start(search: _Search, point: tuple):
    """The point's (S, J, start, pole, delay index) with the start state that suits this stretch best."""
    _, S, J, _, pole, d = point
    near = search.delays[max(d - 1, 0) : d + 2]
    tried = [(float(search.scan([S], [J], r, np.array([pole]), near)[0, 0]), r) for r in (MOVING_UP, *STARTS)]
    return S, J, min(tried)[1], pole, d


def _settle(search: _Search, point: tuple, integrating: bool, steps: tuple[float, ...]):
    """Improve plant, valve and start state in turn, from one point on."""
    error, S, J, start, pole, d = point
    for least in steps:
        error, S, J, start, pole, d = _plant(search, S, J, start, pole, d, integrating)
        near = search.delays[max(d - 2, 0) : d + 3]
        error, S, J, pole = search.descend(S, J, pole, start, near, 4.0 * least, least)
        if start == MOVING_UP:
            rest = [(float(search.scan([S], [J], r, np.array([pole]), near)[0, 0]), r) for r in STARTS]
            if min(rest)[0] < error:
                error, start = min(rest)
    return float(error), float(S), float(J), start, pole, d


def _ranges(search: _Search, point: tuple):
    """S and J that fit about as well: for each J of a list, S and the plant are free to make up for it."""
    S, J, start, pole, d = _start(search, point)
    near = search.delays[max(d - 3, 0) : d + 4]
    best, S_best, J_best, _ = search.descend(S, J, pole, start, near, 0.02, 0.005)
    tried = [(best, S_best, J_best), (best, S, J)]
    for share in J_PROFILE:
        error, s, j, _ = search.descend(S, share * S, pole, start, near, 0.05, 0.012, fixed_J=True)
        tried.append((error, s, j))
    # every half cycle counts as one independent piece of evidence
    least = min(t[0] for t in tried) * (1.0 + 3.84 / max(2.0 * search.cycles, 4.0)) + ENOUGH
    inside = [(s, j) for error, s, j in tried if error <= least]
    return tuple((min(x), max(x)) for x in zip(*inside, strict=True))


def strongest_segment(x: np.ndarray, period: float, length: int) -> tuple[int, int]:
    """Return the stretch of a signal with the largest covariance with itself one period later: large and regular.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Signal.
    period : float
        Period in samples.
    length : int
        Samples wanted.

    Returns
    -------
    start, stop : int
        As in a slice.

    Examples
    --------
    >>> t = np.arange(600)
    >>> strongest_segment(np.sin(t / 5) * (1 + (t > 300)), 10 * np.pi, 200)[0] > 250
    True
    """
    lag = round(period)
    room = length - lag
    if length >= x.size or room < 1:
        return 0, x.size
    x = detrend(x)
    total = np.concatenate([[0.0], np.cumsum(x[lag:] * x[:-lag])])
    start = int(np.argmax(total[room:] - total[:-room]))
    return start, start + length


def swing(op: np.ndarray, period: float) -> float:
    """Return the usual peak-to-peak of OP within a period, in its unit.

    Parameters
    ----------
    op : ndarray, shape (n,)
        Controller output.
    period : float
        Period in samples.

    Returns
    -------
    float
        Median over the whole cycles of the record.

    Examples
    --------
    >>> round(swing(np.sin(np.arange(1000) / 5), 10 * np.pi), 1)
    2.0
    """
    size = min(max(round(period), 2), op.size)
    cycles = op[: op.size // size * size].reshape(-1, size)
    return float(np.median(np.ptp(cycles, axis=1)))


def moving_mean(x: np.ndarray, half: int) -> np.ndarray:
    """Return the mean over `half` samples on either side of each sample, the window cut at the ends, shape (n,)."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    k = np.arange(x.size)
    lo, hi = np.maximum(k - half, 0), np.minimum(k + half + 1, x.size)
    return (total[hi] - total[lo]) / (hi - lo)
