"""Test whether the largest samples of a noise belong to it or are outliers."""

from __future__ import annotations

from math import lgamma

import numpy as np

_DEGREES = (
    2.5,
    3.0,
    4.0,
    5.0,
    7.0,
    10.0,
)  # of freedom of Student's t that are tried for a noise with heavy tails
# of the robust variance; values that stand still would draw the mixture's core together to a point
_NARROWEST = 0.01


def heavy_tails(x: np.ndarray, most: float = 0.5) -> bool:
    """Return whether Student's t is likelier than Gaussian samples of which a share, `most` at
    most, are far wider.
    """
    scale = 1.4826 * float(np.median(np.abs(x)))
    if scale == 0.0:
        return False
    z2 = (x / scale) ** 2
    t = max(_loglik_t(z2, df) for df in _DEGREES)
    share = min(0.02, most)
    narrow = 1.0
    wide = float(np.quantile(z2, 0.99)) + 1.0
    far = near = z2
    for _ in range(30):
        far = share * np.exp(-0.5 * z2 / wide) / np.sqrt(wide)
        near = (1.0 - share) * np.exp(-0.5 * z2 / narrow) / np.sqrt(narrow)
        odds = far / (far + near + 1e-300)
        share = float(np.clip(odds.mean(), 1e-6, most))
        wide = max(float(odds @ z2 / max(odds.sum(), 1e-12)), narrow)
        narrow = max(float((1.0 - odds) @ z2 / (1.0 - odds).sum()), _NARROWEST)
    mixture = float(np.log(far + near + 1e-300).sum()) - 0.5 * z2.size * np.log(2.0 * np.pi)
    return bool(t > mixture)


def _loglik_t(z2: np.ndarray, df: float) -> float:
    """Return the log-likelihood of Student's t at its likeliest scale."""
    variance = 1.0
    for _ in range(20):
        variance = float(np.mean((df + 1.0) * z2 / (df + z2 / variance)))
    whole = lgamma((df + 1.0) / 2) - lgamma(df / 2) - 0.5 * np.log(np.pi * df * variance)
    return float(z2.size * whole - 0.5 * (df + 1.0) * np.log1p(z2 / (df * variance)).sum())
