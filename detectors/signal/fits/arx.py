"""Fit a first-order plant with dead time (ARX model) to valve position and PV by least squares."""

from __future__ import annotations

import numpy as np

from simbench.detectors.compiled import compiled

_ILL = 1e-10  # share of a sum of squares; what is left of it below this is rounding


def fit_plant(
    x: np.ndarray, y: np.ndarray, delays: range
) -> tuple[float, float, float, int, float]:
    """Return (a, b, c, delay, mean squared error) of y(k) = a y(k-1) + b x(k-1-delay) + c, the best
    delay of several.
    """
    estimate = np.empty(5)
    if compiled(_estimate_plant)(
        np.ascontiguousarray(x), np.ascontiguousarray(y), delays[0], delays[-1] + 1, estimate
    ):
        return (*estimate[:3].tolist(), int(estimate[3]), float(estimate[4]))
    return fit_plant_by_columns(x, y, delays)


def fit_plant_by_columns(
    x: np.ndarray, y: np.ndarray, delays: range
) -> tuple[float, float, float, int, float]:
    """Do the same by stacked columns: slow, but also for a valve that hardly moves, whose column is
    nearly that of the ones.
    """
    first = delays[-1] + 1
    best = (0.0, 0.0, 0.0, 0, np.inf)
    target = y[first:]
    before = y[first - 1 : -1]
    for d in delays:
        A = np.column_stack([before, x[first - 1 - d : x.size - 1 - d], np.ones(target.size)])
        a, b, c = np.linalg.lstsq(A, target, rcond=None)[0]
        error = float(np.mean((target - A @ (a, b, c)) ** 2))
        if error < best[4]:
            best = (float(a), float(b), float(c), d, error)
    return best


def _estimate_plant(x, y, least, most, estimate):
    """Fill `estimate` with (a, b, c, delay, error) by the normal equations; return whether these
    were well conditioned.
    """
    # Means and sums that no delay changes
    first = most
    n = y.size
    m = n - first
    estimate[4] = np.inf
    mean_z = mean_y = 0.0
    for k in range(first, n):
        mean_z += y[k - 1] / m
        mean_y += y[k] / m
    zz = zy = 0.0
    for k in range(first, n):
        zz += (y[k - 1] - mean_z) * (y[k - 1] - mean_z)
        zy += (y[k - 1] - mean_z) * (y[k] - mean_y)

    # For every delay: sums over the late input
    for d in range(least, most):
        mean_x = 0.0
        for k in range(first, n):
            mean_x += x[k - 1 - d] / m
        xx = xy = xz = 0.0
        for k in range(first, n):
            v = x[k - 1 - d] - mean_x
            xx += v * v
            xy += v * (y[k] - mean_y)
            xz += v * (y[k - 1] - mean_z)

        # The normal equations of two unknowns; an ill-conditioned pair has no answer
        det = zz * xx - xz * xz
        if not det > _ILL * zz * xx or xx <= _ILL * m * mean_x * mean_x:
            return False
        a = (zy * xx - xy * xz) / det
        b = (xy * zz - zy * xz) / det
        c = mean_y - a * mean_z - b * mean_x

        # The error that this delay leaves; the least one stays
        error = 0.0
        for k in range(first, n):
            left = y[k] - (a * y[k - 1] + b * x[k - 1 - d] + c)
            error += left * left / m
        if error < estimate[4]:
            estimate[0] = a
            estimate[1] = b
            estimate[2] = c
            estimate[3] = d
            estimate[4] = error
    return True
