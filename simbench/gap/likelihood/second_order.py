"""Fit a valve or positioner of second order without friction to recorded OP and MV: it overshoots,
and what it does between samples looks like a band.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import scipy

from simbench.detectors.signal.filters import lfilter
from simbench.gap.likelihood.valve_map import MapFit, MapSearch
from simbench.gap.thresholds import OVERSHOOTS

_TIMES = np.geomspace(0.3, 60.0, 24)  # samples, 1/omega that are tried
_CLEAR = 10.0  # nats from which a valve that overshoots is believed
_DAMPINGS = (0.08, 0.15, 0.3, 0.5, 0.8)


def second_order(search: MapSearch) -> MapFit:
    """Return the nats over the baseline's valve and the numbers: `tau` (s), the inverse of the
    natural frequency, and `damping`.
    """

    def level(x: np.ndarray) -> float:
        return search.level(
            lag_second_order(search.op, *np.exp(np.clip(x, -4.0, 6.0)), search.mv[0])
        )

    tried = [np.log((tau, damping)) for tau, damping in product(_TIMES, _DAMPINGS)]
    best = min(tried, key=level)
    found = scipy.optimize.minimize(
        level, best, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-2}
    )
    tau, damping = np.exp(np.clip(found.x, -4.0, 6.0))
    numbers: dict[str, float | str] = {"tau": float(tau) * search.Ts, "damping": float(damping)}
    return search.priced(float(found.fun), numbers, 2.0)


def positioner(search: MapSearch) -> MapFit | None:
    """Return nats and numbers of a valve that overshoots without friction; None where MV does not
    overshoot.
    """
    gain, numbers = second_order(search)
    return None if float(numbers["damping"]) > OVERSHOOTS or gain <= _CLEAR else (gain, numbers)


def lag_second_order(op: np.ndarray, tau: float, damping: float, first: float) -> np.ndarray:
    """Return OP (n,) after a second-order lag under an input held over each sample, at rest at
    `first` before it.
    """
    num, den = [1.0], [tau * tau, 2.0 * damping * tau, 1.0]
    discrete: Any = scipy.signal.cont2discrete((num, den), 1.0, method="zoh")
    b, a = discrete[:2]
    # where it stands at the end of each sample, as MV is the position there
    return first + lfilter(np.asarray(b).ravel()[1:], np.asarray(a), op - first)
