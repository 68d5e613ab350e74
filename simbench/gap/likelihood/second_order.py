"""Fit a valve or positioner of second order without friction to recorded OP and MV: it overshoots,
and what it does between samples looks like a band.
"""

from __future__ import annotations

import cmath
import math
from itertools import product

import numpy as np
import scipy

from simbench.detectors.signal.filters import lfilter
from simbench.gap.likelihood.valve_map import MapFit, MapSearch
from simbench.gap.thresholds import OVERSHOOTS

_TIMES = np.geomspace(0.3, 60.0, 24)  # samples, 1/omega that are tried
_CLEAR = 10.0  # nats from which a valve that overshoots is believed
_MEET = 1e-9  # 1/samples between two poles that count as one
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
    if float(numbers["damping"]) > OVERSHOOTS or gain <= _CLEAR:
        return None
    return (gain, numbers)


def lag_second_order(op: np.ndarray, tau: float, damping: float, first: float) -> np.ndarray:
    """Return OP (n,) after a second-order lag under an input held over each sample, at rest at
    `first` before it.
    """
    b, a = held(tau, damping)
    # where it stands at the end of each sample, as MV is the position there
    return first + lfilter(b, a, op - first)


def held(tau: float, damping: float) -> tuple[list[float], list[float]]:
    """Return numerator and denominator in powers of 1/z of 1/(tau^2 s^2 + 2 damping tau s + 1)
    under an input held over each sample of length 1, without the sample of delay.

    Astrom and Wittenmark (1997), Computer-Controlled Systems, table 2.1.
    """
    decay = damping / tau
    turn = cmath.sqrt(damping * damping - 1.0) / tau
    one = cmath.exp(turn - decay)
    other = cmath.exp(-turn - decay)
    even = 0.5 * (one + other).real
    # at critical damping the poles meet, and (one - other)/(2 turn) is their value
    odd = decay * ((one - other) / (2.0 * turn) if abs(turn) > _MEET else one).real
    both = math.exp(-2.0 * decay)
    return [1.0 - even - odd, both - even + odd], [1.0, -2.0 * even, both]
