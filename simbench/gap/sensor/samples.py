"""Find from single samples what the sensor and the archive do: quantisation, interpolated lines,
spikes, repeated values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from detectors.signal.holds import holds, stuck
from detectors.signal.lattice import written
from detectors.signal.lines import share_on_lines
from detectors.signal.spikes import isolated, off_line
from detectors.signal.tails import heavy_tails


@dataclass(frozen=True, eq=False)
class Samples:
    """Sample-level findings on PV.

    `resolution` is the decimal unit PV is written in (0 = full precision), `step` a lattice coarser
    than that (0 = none), `straight` the share of samples on a straight line with both neighbours
    beyond chance, `spikes` the indices of isolated points, `heights` how far off they are, `held`
    the longest exact standstill in samples, `stuck` the share of samples in standstills longer than
    rounding and noise explain; `heavy` whether the largest samples are no spikes but the tails of
    the noise.
    """

    resolution: float
    step: float
    straight: float
    spikes: np.ndarray
    heights: np.ndarray
    held: int
    stuck: float
    heavy: bool = False

    @property
    def digits(self) -> float:
        """The coarser of `resolution` and `step`."""
        return max(self.resolution, self.step)


def inspect_samples(pv: np.ndarray, *others: np.ndarray, noise: float = 0.0) -> Samples:
    """Look at PV sample by sample."""
    is_written = written(pv, *others)
    unit, step = is_written.unit, is_written.step
    rounding = max(unit, step)
    spikes, heights = isolated(pv, rounding)
    # a spike is off the line of its neighbours, and in the line of four: where more is wide, that
    # is not the spikes
    most = min(5.0 * spikes.size / len(pv), 0.5)
    heavy = spikes.size > 0 and heavy_tails(off_line(np.asarray(pv, dtype=float))[0], most)
    if heavy:
        spikes, heights = spikes[:0], heights[:0]
    return Samples(
        unit,
        step,
        0.0 if is_written.coarse else share_on_lines(pv, rounding, noise),
        spikes,
        heights,
        int(holds(pv).max()),
        stuck(pv, unit),
        heavy,
    )
