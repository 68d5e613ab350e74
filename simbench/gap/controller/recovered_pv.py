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
from simbench.gap.controller.regression import solve_least_squares

# misfit where the archive keeps PV exactly, relative to the misfit elsewhere, below which OP is
# believed
FAITHFUL = 0.2
# rms error of a rounded archive, in its steps, below which OP is believed; rounding alone gives
# 1/sqrt(12) = 0.29
ROUNDED = 0.35
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


def hidden_law(
    op: np.ndarray,
    e: np.ndarray,
    Kc: float,
    Ki: float,
    exact: np.ndarray,
) -> _Hidden:
    """Fit the law by the error it implies, compared with the recorded one only where the archive
    kept it.

    A regression of OP on the recorded error would be biased by the archive's error; here the
    error is the output.
    """
    y = e[exact]
    drive = np.append(0.0, np.diff(op))
    unit = (np.arange(op.size) == 0).astype(float)

    def channels(forget: float) -> np.ndarray:
        of_both = [lfilter([1.0], [1.0, -forget], x) for x in (drive, unit)]
        return np.column_stack(of_both)[exact]

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
    a = 1.0 / float(beta[0]) if beta[0] != 0.0 else np.inf
    left = y - X0[:, 0] / (Kc + Ki)
    start = X0[:, 1:]
    left = left - start @ solve_least_squares(start, left)
    return _Hidden(a, -forget * a, float(np.std(y - X @ beta)), float(np.std(left)))
