"""Find a valve that does not follow OP because its speed is limited, opening and closing apart, by
recorded OP and MV.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy

from simbench.gap.effects.valve_lag import by_mv as lag_by_mv
from simbench.gap.likelihood.kernels import limit_rate
from simbench.gap.likelihood.valve_map import MapSearch
from simbench.gap.thresholds import BY_MV, MV_LEFT, SLOW_FAR

_RATES = np.geomspace(0.01, 30.0, 24)  # of OP's mean move from sample to sample, that are tried
_REACHED = 1e-6  # % of travel between OP and a valve that has reached it
_ON_ITS_WAY = 0.9  # of the samples: a valve that hardly ever reaches OP is no slow one


@dataclass(frozen=True)
class SlowValve:
    """A valve that follows OP at a limited speed."""

    # opening, closing: largest speed (% of travel a second)
    opening: float
    closing: float
    far: float  # largest distance from OP (% of travel)
    share: float  # of the samples, in which it is on its way

    def sentence(self) -> str:
        """Return how far the valve stays behind OP, how often, and its speeds."""
        return (
            f"MV stays behind OP by up to {self.far:.2g} % of travel without friction, and is on"
            f" its way in {self.share:.0%} of the samples: it moves at most {self.opening:.2g} %"
            f" a second up and {self.closing:.2g} % down"
        )


def slow_valve(search: MapSearch) -> tuple[float, SlowValve] | None:
    """Return the nats that two limits of speed bring over a valve that follows OP, and the valve;
    None where they bring little, less than a lag, or leave much, and where MV is never far from OP
    or never there.
    """
    # both speeds, from a coarse grid
    unit = float(np.mean(np.abs(np.diff(search.op)))) or 1.0

    def level(x: np.ndarray) -> float:
        up, down = unit * np.exp(np.clip(x, -9.0, 9.0))
        return search.level(limit_rate(search.op, up, down))

    starts = np.log(np.array(list(product(_RATES, _RATES))))
    best = starts[int(np.argmin([level(x) for x in starts]))]
    found = scipy.optimize.minimize(level, best, method="Nelder-Mead")

    # what they explain, and a lag as well
    gain = search.priced(float(found.fun), {}, 2.0)[0]
    if gain <= max(float(BY_MV), lag_by_mv(search)[0]):
        return None

    # how far the valve is off, and how often
    up, down = (float(x) for x in unit * np.exp(np.clip(found.x, -9.0, 9.0)))
    moved = limit_rate(search.op, up, down)
    off = np.abs(search.op - moved)
    left = np.std(search.mv - moved) / max(float(np.std(search.mv - search.op)), 1e-300)
    share = float(np.mean(off > _REACHED))
    if left > MV_LEFT or share > _ON_ITS_WAY or off.max() < SLOW_FAR:
        return None
    return gain, SlowValve(up / search.Ts, down / search.Ts, float(off.max()), share)
