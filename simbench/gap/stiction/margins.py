"""Compute the stability margins of an identified loop: gain margin, largest sensitivity and
resonance period.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from simbench.scenarios.spec import Loop
from simbench.theory.sampled import phase_crossings

_POINTS = 1500  # frequencies of the response


@dataclass(frozen=True)
class Margins:
    """Gain margin, largest sensitivity, and the period (s) of the largest sensitivity; `gains` are
    the least and the largest gain margin, and `most` the largest sensitivity, of all loops that may
    have made the record.
    """

    gain: float
    sensitivity: float
    period: float
    gains: tuple[float, float] = (np.inf, 0.0)
    most: float = 0.0

    def sentence(self) -> str:
        """Return the margins in words."""
        lo, hi = self.gains
        between = f" ({lo:.2g} to {hi:.2g})" if hi > 1.01 * lo else ""
        return (
            f"gain margin {self.gain:.2g}{between}, largest sensitivity {self.sensitivity:.2g} at"
            f" a period of {self.period:.3g} s"
        )


def margins_among(loop: Loop, others: Iterable[Loop]) -> Margins | None:
    """Return the margins of a loop, with the range of those of others that may have made the same
    record; None where they are unknown.
    """
    own = margins(loop)
    if own is None:
        return None
    every = [own, *filter(None, map(margins, others))]
    gains = [one.gain for one in every]
    most = max(one.sensitivity for one in every)
    return replace(own, gains=(min(gains), max(gains)), most=most)


def margins(loop: Loop) -> Margins | None:
    """Return the margins of a loop, the hold of its sampling counted as half a sample of dead time;
    None of other plants. A loop whose record does not run away has a gain margin of 1 at least,
    whatever was identified.
    """
    plant = loop.plant
    pi = loop.controller
    if plant.type not in ("foptd", "integrating") or pi.type not in ("P", "PI"):
        return None
    Ts = loop.sampling.Ts
    T = float(plant.T or 0.0)
    Ti = float(pi.Ti or np.inf)
    slow = max(T, Ti if np.isfinite(Ti) else 0.0, plant.Td, 10.0 * Ts)
    w = np.geomspace(0.02 / slow, np.pi / Ts, _POINTS)
    s = 1j * w
    process = abs(plant.K) / (s if plant.type == "integrating" else 1.0 + s * T)
    controller = pi.Kc * (1.0 if pi.type == "P" else 1.0 + 1.0 / (s * Ti))
    open_loop = process * controller * np.exp(-s * (plant.Td + 0.5 * Ts))
    size = 1.0 / np.abs(1.0 + open_loop)
    k = int(np.argmax(size))
    # infinite where the phase never crosses -180 degrees
    crossed = open_loop[phase_crossings(open_loop)]
    gain = max(float(1.0 / np.abs(crossed).max()), 1.0) if crossed.size else np.inf
    return Margins(gain, float(size[k]), float(2.0 * np.pi / w[k]))
