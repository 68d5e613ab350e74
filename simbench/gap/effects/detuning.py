"""Detuning recognised: a PI law explains OP exactly, but with another tuning than the
baseline's.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._draw import Size, Yardstick, between
from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.effects._smallest import Probe

_WAYS = (
    (1, 0),
    (-1, 0),
    (1, 1),
    (-1, 1),
    (1, -1),
    (-1, -1),
    (0, 1),
    (0, -1),
)  # of Kc and Ti; the first two for P


def smallest(probe: Probe) -> tuple[float, str] | None:
    """Return the factor from which the tuning counts as another one; only where the law is
    known.
    """
    return (1.14, "factor") if probe.situation.law.known else None


def draw(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw which of Kc and Ti, and which way."""
    Kc, Ti = _WAYS[int(rng.integers(len(_WAYS) if y.integral else 2))]
    return lambda x: {
        "Kc_factor": between(x, 1.05, 6.0) ** Kc,
        "Ti_factor": between(x, 1.1, 8.0) ** Ti,
    }


RECOGNISER = Recogniser(
    proven=lambda s: (
        None if s.law.tuning is None else dict(zip(("Kc_factor", "Ti_factor"), s.law.tuning))
    ),
    explains="tuning",
    needs="tuning",
    smallest=smallest,
    draw=draw,
)
