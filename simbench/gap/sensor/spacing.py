"""The lattice on which a signal's levels stand, wherever it begins, linear or in the square root."""

from __future__ import annotations

import numpy as np

from simbench.gap.sensor.samples import resolution

FEWEST_LEVELS = 10  # gaps; fewer lie evenly by chance
ON_LATTICE = 0.9  # mean length of the phases; ten values that lie anywhere reach it three times in 10 000


def spacing(x: np.ndarray) -> tuple[float, int]:
    """Return the spacing of the lattice, wherever it begins, on which a signal stands, and how many of its levels are met.

    Parameters
    ----------
    x : ndarray, shape (n,)

    Returns
    -------
    step : float
        In units of x, at its mean for the square-root lattice; 0 when the levels lie anywhere.
    levels : int

    Notes
    -----
    A transmitter counts from the lower end of its range, so its lattice need not hold 0; a flow is the square root of the
    differential pressure that was digitised, so its lattice may lie in PV^2. The levels' phases over one step are put on a
    circle (Rayleigh's test): for values that lie anywhere their mean is about 1/sqrt(levels) long, on a lattice 1. Not for
    a file's own decimals: a transmitter of the same step could not be told from them.

    Examples
    --------
    >>> x = 3.3 + 0.25 * np.round(np.random.default_rng(0).standard_normal(400) * 5)
    >>> round(spacing(x)[0], 6)
    0.25
    """
    levels = np.unique(x)
    # files keep digits, not decimals: the largest values are the coarsest
    size = np.abs(levels)
    unit = resolution(levels[size >= 10.0 ** np.floor(np.log10(max(float(size.max()), 1e-300)))])
    for y, slope in ((levels, 1.0), (levels * np.abs(levels), 2.0 * float(np.abs(levels).mean()))):
        gaps = np.diff(y)
        gaps = gaps[gaps > 1.5 * unit * slope]
        if gaps.size < FEWEST_LEVELS:
            break
        step = float(np.median(gaps[gaps <= 1.5 * np.quantile(gaps, 0.05)]))
        for reach in (4.0, 40.0, np.inf):
            near = gaps[gaps < reach * step]
            step = float(near.sum() / np.round(near / step).sum())
        phase = abs(np.mean(np.exp(2j * np.pi * (y - y[0]) / step)))
        if phase > ON_LATTICE and step > 2.0 * unit * slope:
            return step / slope, levels.size
    return 0.0, levels.size
