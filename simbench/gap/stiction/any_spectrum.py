"""Compute the log-likelihood of what a model leaves of a record, under a load and a noise of any
spectrum.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.likelihood.kernels import SKIP
from simbench.gap.likelihood.model import Fit

_LAGS = 24  # of the autoregression that gives load and noise the spectrum they have
_PER_LAG = 6  # samples for each of them, at least


def any_spectrum(left: np.ndarray) -> np.ndarray:
    """Return the log-likelihood of standardised innovations, but for a constant, once their past
    has explained what a model's load leaves in them.
    """
    count = min(_LAGS, left.size // _PER_LAG)
    past = np.lib.stride_tricks.sliding_window_view(left[:-1], count)
    now = left[count:]
    error = now - past @ np.linalg.lstsq(past, now, rcond=None)[0]
    power = float(np.mean(error * error)) or 1.0
    nats = -0.5 * (error * error / power + np.log(power))
    return np.concatenate([-0.5 * left[:count] ** 2, nats])


def nats_of(fit: Fit, price: float) -> np.ndarray:
    """Return the log-likelihood of each sample with a fit, under a load of any spectrum, less its
    share of the price of the numbers fitted.
    """
    left = np.asarray(fit.residual[SKIP:])
    return (fit.loglik + 0.5 * float(left @ left) - price) / left.size + any_spectrum(left)
