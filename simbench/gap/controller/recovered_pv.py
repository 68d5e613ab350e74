"""Recover from OP the error that the controller acted on; OP is stored exactly even where PV is
compressed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from scipy.special import expit

from simbench.detectors.signal.filters import lfilter
from simbench.detectors.signal.holds import runs_of
from simbench.gap.controller.law import about_zero, solve_least_squares

# misfit where the archive keeps PV exactly, relative to the misfit elsewhere, below which OP is
# believed
FAITHFUL = 0.2
# rms error of a rounded archive, in its steps, below which OP is believed; rounding alone gives
# 1/sqrt(12) = 0.29
ROUNDED = 0.35
MEAN_OVER = (-2, -1, 0, 1, 2)  # samples over which an archive may take a mean
# how far a mean's weights may miss 1 in sum, and the least of them: without either one tuning of
# 129 records is another
_SUM = 0.1
_LEAST_WEIGHT = -0.2
_BLURRED = 0.2  # of PV's moves, that such a mean may leave
GRID = 60  # integral times tried, from a twentieth to twenty times the baseline's


class _Hidden(NamedTuple):
    """A PI law fitted through a poor archive: `a`, `b` of dOP = a e_k + b e_{k-1}, and its rms
    misfit to the recorded error.

    `base` is the rms misfit of the baseline's tuning.
    """

    a: float
    b: float
    misfit: float
    base: float


def recover_pv(
    op: np.ndarray,
    e: np.ndarray,
    pv: np.ndarray,
    inside: np.ndarray,
    a: float,
    b: float,
    memoryless: bool,
) -> np.ndarray | None:
    """Return the PV that makes the controller write this OP."""
    if a == 0.0:  # OP tells nothing of the error
        return None
    if memoryless:
        gain = 0.5 * (a - b)
        return pv + e - np.where(inside, (op - np.median(op - gain * e)) / gain, e)
    forget = -b / a
    if not 0.0 <= forget < 0.9999:
        return None
    drive = np.append(0.0, np.diff(op) / a)
    out = e.copy()

    # between limits the inversion is a first-order filter; a controller that holds its integral at
    # a limit leaves it by another step
    for begin, end in runs_of(inside):
        out[begin:end] = lfilter([1.0], [1.0, -forget], np.append(e[begin], drive[begin + 1 : end]))
    return pv + e - out


def rest_of_mean(pv: np.ndarray, seen: np.ndarray) -> float:
    """Return what is left of an archive's PV after a mean of what the controller saw, over a
    sample or within one.
    """
    weights = _fit_weights(pv, seen)
    one = abs(float(weights.sum()) - 1.0) < _SUM and float(weights.min()) > _LEAST_WEIGHT
    left = pv - pv.mean() - _shift_columns(seen - seen.mean()) @ weights
    rest = about_zero(left[2:-2]) / (float(np.std(np.diff(pv))) or 1.0)
    return rest if one and rest < _BLURRED else np.inf


def mean_like(pv: np.ndarray, seen: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return `other` averaged over neighbouring samples in the way that makes what the controller
    saw nearest to the archive's PV.
    """
    weights = _fit_weights(pv, seen)
    return _shift_columns(other) @ (weights / weights.sum())


def _shift_columns(x: np.ndarray, over: tuple[int, ...] = MEAN_OVER) -> np.ndarray:
    return np.column_stack([np.roll(x, shift) for shift in over])


def _fit_weights(pv: np.ndarray, seen: np.ndarray) -> np.ndarray:
    return solve_least_squares(_shift_columns(seen - seen.mean())[2:-2], (pv - pv.mean())[2:-2])


def hidden_law(
    op: np.ndarray,
    e: np.ndarray,
    Kc: float,
    Ki: float,
    exact: np.ndarray,
    over: tuple[int, ...] = (0,),
) -> _Hidden:
    """Fit the law by the error it implies, compared with the recorded one only where the archive
    kept it.

    A regression of OP on the recorded error would be biased by the archive's error; here the
    error is the output.
    """
    y = e[exact]
    many = len(over)
    drive = np.append(0.0, np.diff(op))
    unit = (np.arange(op.size) == 0).astype(float)

    def channels(forget: float) -> np.ndarray:
        of_op = lfilter([1.0], [1.0, -forget], drive)
        of_start = lfilter([1.0], [1.0, -forget], unit)
        return np.column_stack([_shift_columns(of_op, over), of_start])[exact]

    def misfit(log_wait: float) -> float:
        X = channels(expit(log_wait))
        return float(np.std(y - X @ solve_least_squares(X, y)))

    # of a wait of Ti/Ts samples; a controller without integral forgets no error
    stated = forget = Kc / (Kc + Ki)
    if Ki != 0.0:
        grid = np.log(Kc / Ki) + np.linspace(-3.0, 3.0, GRID)
        best = grid[int(np.argmin([misfit(x) for x in grid]))]
        width = grid[1] - grid[0]
        forget = expit(
            scipy.optimize.minimize_scalar(
                misfit,
                bounds=(best - width, best + width),
                method="bounded",
                options={"xatol": 1e-6},
            ).x
        )
    X = channels(forget)
    X0 = channels(stated)
    beta = solve_least_squares(X, y)
    total = float(beta[:many].sum())
    if total != 0.0:
        a = 1.0 / total
    else:
        a = np.inf
    left = y - X0[:, :many].mean(axis=1) / (Kc + Ki)
    start = X0[:, many:]
    left = left - start @ solve_least_squares(start, left)
    return _Hidden(a, -forget * a, float(np.std(y - X @ beta)), float(np.std(left)))
