"""What a law does to the signal between OP and PV, in samples: zeros and resonances."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from simbench.gap.likelihood.valve_map import lagged


def led(u: np.ndarray, lead: float, lag: float) -> np.ndarray:
    """Return u (n,) behind (lead s + 1)/(lag s + 1), in samples, begun at rest."""
    slow = lagged(u, max(lag, 0.05))
    return slow + (lead / max(lag, 0.05)) * (u - slow)


def rung(u: np.ndarray, period: float, damping: float) -> np.ndarray:
    """Return u (n,) behind a pair of poles of a natural period (samples) and a damping, begun at rest."""
    w, z = 2.0 * np.pi / period, min(damping, 0.999)
    wd, a = w * np.sqrt(1.0 - z * z), np.exp(-z * w)
    den = [1.0, -2.0 * a * np.cos(wd), a * a]
    # the sampled pair with the same steady gain; its zero lies where the hold puts it
    c, sn = np.cos(wd), np.sin(wd) * z * w / wd
    num = [0.0, 1.0 - a * (c + sn), a * a + a * (sn - c)]
    return u[0] + lfilter(num, den, u - u[0])
