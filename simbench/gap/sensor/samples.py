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

# An archive that reports by exception stores no move within its band. Of moves that are not
# filtered so, the smallest hundredth lies below .02 of the median (normal law: .019), and a written
# PV has moves of one and two digits.
_EXCEPTION, _DIGITS, _MOVES = 0.2, 3.0, 30


@dataclass(frozen=True, eq=False)
class Samples:
    """Sample-level findings on PV.

    `resolution` is the decimal unit PV is written in (0 = full precision), `step` a lattice coarser
    than that (0 = none), `straight` the share of samples on a straight line with both neighbours
    beyond chance, `spikes` the indices of isolated points, `heights` how far off they are, `held`
    the longest exact standstill in samples, `stuck` the share of samples in standstills longer than
    rounding and noise explain; `heavy` whether the largest samples are no spikes but the tails of
    the noise; `by_exception` whether an archive repeats PV until it leaves a band.
    """

    resolution: float
    step: float
    straight: float
    spikes: np.ndarray
    heights: np.ndarray
    held: int
    stuck: float
    heavy: bool = False
    by_exception: bool = False

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
        reported_by_exception(pv, rounding),
    )


def reported_by_exception(pv: np.ndarray, rounding: float) -> bool:
    """Return whether PV repeats values between moves that are all wider than some band."""
    moves = np.abs(np.diff(pv))
    repeats, moves = np.mean(moves == 0.0), moves[moves > 0.0]
    if moves.size < _MOVES or not repeats:
        return False
    least = float(np.quantile(moves, 0.01))
    return least > max(_DIGITS * rounding, _EXCEPTION * float(np.median(moves)))
