"""Test the prediction errors of the best model; what it does not explain leads to the answer
"unknown".
"""

from __future__ import annotations

import numpy as np
import scipy

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit

# share of PV's standard deviation: innovations below it are a simulation's, and nothing can be
# missing from them
_NOTHING = 1e-4
# samples over which a jump of PV is compared with what it may be else, and the first that are not
# asked
_REACH = 400
_START = 10
_BESIDE = 7  # samples about a jump in which the others may lie


def tests_of(engine: Engine, fit: Fit) -> dict[str, float]:
    """Return every test of a fit by name, all 0 where the model explains PV to the last digit."""
    results = residual_tests(fit, engine.data)
    if innovation_std(fit) < _NOTHING * engine.data.size:
        return dict.fromkeys(results, 0.0)
    return results


def shifts(engine: Engine, fit: Fit) -> float:
    """Return the nats of the clearest jump of PV within a sample, to stay, on top of a wild sample
    and of a jump of the load in its place, less those that chance brings.
    """
    residual = np.asarray(fit.residual).copy()
    residual[: kernels.SKIP] = 0.0
    n = residual.size
    reach = min(_REACH, residual.size // 3)
    model = engine.noise_model(fit.spec, fit.theta)
    step = (np.arange(n) >= reach).astype(float)
    wild = (np.arange(n) == reach).astype(float)
    load = np.roll(kernels.plant(step, model.T, 0.0, model.tau), -1)
    seen = kernels.whiten(np.array([step, wild, load]), model, kernels.NO_JUMPS)[0]
    seen = seen[:, reach : 2 * reach]
    along = np.array([np.correlate(residual, one, "valid") for one in seen])

    def nats(rows: slice) -> np.ndarray:
        squares = seen[rows] @ seen[rows].T
        least = _NOTHING**2 * np.trace(squares) * np.eye(len(squares))
        return 0.5 * np.sum(along[rows] * np.linalg.solve(squares + least, along[rows]), axis=0)

    # what is beside explains a part of it too
    others = scipy.ndimage.maximum_filter1d(nats(slice(1, 3)), _BESIDE)
    return float((nats(slice(3)) - others)[_START:].max() - np.log(n))


def innovation_std(fit: Fit) -> float:
    """Return the innovations' standard deviation (PV units), from the likelihood."""
    left = np.asarray(fit.residual)[kernels.SKIP :]
    log_variance = (
        -2.0 * fit.loglik / left.size - float(left @ left) / left.size - np.log(2.0 * np.pi)
    )
    return float(np.exp(0.5 * log_variance))


def residual_tests(fit: Fit, data: Data) -> dict[str, float]:
    """Return what is left in the innovations of a fit; each is near 0 (in standard deviations) when
    the model is whole.

    `memory`: correlation over 25 lags; `input`: correlation with past OP.
    """
    x = np.asarray(fit.residual)[kernels.SKIP :]
    x = np.clip(x, -6.0, 6.0) - np.mean(x)
    n = x.size
    power = float(np.mean(x**2)) or 1.0
    lags = min(25, n // 4)
    rho = np.array([float(np.mean(x[k:] * x[:-k])) / power for k in range(1, lags + 1)])
    du = np.diff(data.u)[kernels.SKIP - 1 :]
    du = (du - du.mean()) / (float(np.std(du)) or 1.0)
    cross = np.array(
        [float(np.mean(x[k:] * du[: n - k])) / np.sqrt(power) for k in range(1, lags + 1)]
    )
    return {
        "memory": float((n * np.sum(rho**2) - lags) / np.sqrt(2 * lags)),
        "input": float((n * np.sum(cross**2) - lags) / np.sqrt(2 * lags)),
    }
