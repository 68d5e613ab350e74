"""Compute the stability margins of an identified loop: gain margin, largest sensitivity and
resonance period.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from simbench.gap.closed_loop.described import FREQUENCIES, gain_margin, open_loop
from simbench.scenarios.spec import Loop


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
        if hi > 1.01 * lo:
            between = f" ({lo:.2g} to {hi:.2g})"
        else:
            between = ""
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
    """Return the margins of a loop by its sampled response; None of a controller that has none. A
    loop whose record does not run away has a gain margin of 1 at least, whatever was identified.
    """
    L = open_loop(loop)
    if L is None:
        return None
    size = 1.0 / np.abs(1.0 + L)
    k = int(np.argmax(size))
    period = 2.0 * np.pi / FREQUENCIES[k] * loop.sampling.Ts
    return Margins(max(gain_margin(loop), 1.0), float(size[k]), float(period))
