"""Test the prediction errors of a fit: the nats that a plain model of these errors would explain,
beyond what chance brings.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit

# share of PV's standard deviation: innovations below it are a simulation's, and nothing can be
# missing from them
_NOTHING = 1e-4
_LAGS = 25  # samples over which innovations may remember, or follow from OP
# samples over which a jump of PV is compared with what it may be else, and the first that are not
# asked
_REACH = 400
_START = 10
_BESIDE = 7  # samples about a jump in which the others may lie


def memory_and_input(fit: Fit, data: Data) -> dict[str, float]:
    """Return the nats of correlations of innovations over 25 lags, with themselves (`memory`) and
    with past OP (`input`); 0 where the model explains PV to the last digit.
    """
    if innovation_std(fit) < _NOTHING * data.size:
        return {"memory": 0.0, "input": 0.0}

    # innovations and changes of OP of unit size
    x = np.asarray(fit.residual)[kernels.SKIP :]
    x = np.clip(x, -6.0, 6.0) - np.mean(x)
    n = x.size
    power = float(np.mean(x**2)) or 1.0
    du = np.diff(data.u)[kernels.SKIP - 1 :]
    du = (du - du.mean()) / (float(np.std(du)) or 1.0)

    # a squared correlation of chance is worth half a nat for each of its n samples
    lags = range(1, min(_LAGS, n // 4) + 1)
    rho = np.array([float(np.mean(x[k:] * x[:-k])) / power for k in lags])
    cross = np.array([float(np.mean(x[k:] * du[: n - k])) / np.sqrt(power) for k in lags])
    seen = {"memory": rho, "input": cross}
    return {name: 0.5 * float(n * np.sum(r**2) - r.size) for name, r in seen.items()}


def shifts(engine: Engine, fits: Sequence[Fit]) -> list[float]:
    """Return, of fits of one model to several records, the nats of the clearest jump of PV within a
    sample, to stay, on top of a wild sample and of a jump of the load in its place, less those that
    chance brings.
    """
    # what each of the three leaves in the innovations
    n = engine.data.n
    reach = min(_REACH, n // 3)
    model = engine.noise_model(fits[0].spec, fits[0].theta)
    step = (np.arange(n) >= reach).astype(float)
    wild = (np.arange(n) == reach).astype(float)
    load = np.roll(kernels.plant(step, model.T, 0.0, model.tau), -1)
    seen = kernels.whiten(np.array([step, wild, load]), model, kernels.NO_JUMPS)[0]
    seen = seen[:, reach : 2 * reach]

    def nats(along: np.ndarray, rows: slice) -> np.ndarray:
        squares = seen[rows] @ seen[rows].T
        least = _NOTHING**2 * np.trace(squares) * np.eye(len(squares))
        return 0.5 * np.sum(along[rows] * np.linalg.solve(squares + least, along[rows]), axis=0)

    # where each record's innovations are most like the three together
    found = []
    for fit in fits:
        residual = np.asarray(fit.residual).copy()
        residual[: kernels.SKIP] = 0.0
        along = np.array([scipy.signal.correlate(residual, one, "valid") for one in seen])
        # what is beside explains a part of it too
        others = scipy.ndimage.maximum_filter1d(nats(along, slice(1, 3)), _BESIDE)
        found.append(float((nats(along, slice(3)) - others)[_START:].max() - np.log(n)))
    return found


def innovation_std(fit: Fit) -> float:
    """Return the innovations' standard deviation (PV units), from the likelihood."""
    left = np.asarray(fit.residual)[kernels.SKIP :]
    log_variance = (
        -2.0 * fit.loglik / left.size - float(left @ left) / left.size - np.log(2.0 * np.pi)
    )
    return float(np.exp(0.5 * log_variance))
