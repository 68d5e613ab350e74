"""Find from single samples what the sensor and the archive do: quantisation, interpolated lines,
spikes, repeated values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.signal.holds import holds, share_on_lines, stuck
from simbench.detectors.signal.lattice import read_lattice
from simbench.detectors.signal.spikes import find_spikes, heavy_tails, off_line

# An archive that reports by exception stores no move within its band: none is smaller, where moves
# that are not filtered so would be as many within it as in the width next to it.
_DIGITS = 3.0
_MOVES = 20
_EXCUSED = 0.05
_ROUGH = 2.5  # bands, of a typical move from which standstills are no longer those of a slow signal


@dataclass(frozen=True, eq=False)
class Samples:
    """Sample-level findings on PV.

    `resolution` is the decimal unit PV is written in (0 = full precision), `step` a lattice coarser
    than that (0 = none), `straight` the share of samples on a straight line with both neighbours
    beyond chance, `spikes` the indices of isolated points, `heights` how far off they are, `held`
    the longest exact standstill in samples, `stuck` the share of samples in standstills longer than
    rounding and noise explain; `band` of an archive that repeats PV until it leaves it by more (0 =
    none).
    """

    resolution: float
    step: float
    straight: float
    spikes: np.ndarray
    heights: np.ndarray
    held: int
    stuck: float
    band: float = 0.0

    @property
    def digits(self) -> float:
        """The coarser of `resolution` and `step`."""
        return max(self.resolution, self.step)

    @property
    def hidden(self) -> float:
        """Width of the interval of PV (PV units) that a value on record may stand for."""
        return max(self.digits, 2.0 * self.band)


def inspect_samples(pv: np.ndarray, *others: np.ndarray, noise: float = 0.0) -> Samples:
    """Look at PV sample by sample."""
    is_written = read_lattice(pv, *others)
    unit = is_written.unit
    step = is_written.step
    rounding = max(is_written.unit, is_written.step)
    spikes, heights = find_spikes(pv, rounding)

    # a spike is off the line of its neighbours, and in the line of four: where more is wide, that
    # is not the spikes but the tails of the noise
    most = min(5.0 * spikes.size / len(pv), 0.5)
    if spikes.size > 0 and heavy_tails(off_line(np.asarray(pv, dtype=float))[0], most):
        spikes = spikes[:0]
        heights = heights[:0]
    band = exception_band(pv, rounding)
    moves = np.abs(np.diff(pv))

    # what moves by little more than the band each time rests within it by nature
    rough = band == 0.0 or float(np.median(moves[moves > 0.0])) > _ROUGH * band
    return Samples(
        unit,
        step,
        0.0 if is_written.coarse else share_on_lines(pv, rounding, noise),
        spikes,
        heights,
        int(holds(pv).max()),
        stuck(pv, max(unit, 2.0 * band)) if rough else 0.0,
        band,
    )


def exception_band(x: np.ndarray, rounding: float) -> float:
    """Return the band within which an archive repeats a signal's last value; 0 where it does not.

    A time limit may store a few smaller moves.
    """
    moves = np.sort(np.abs(np.diff(x)))
    repeats = int(np.count_nonzero(moves == 0.0))
    moves = moves[repeats:]
    for smaller in range(0, moves.size // 50 + 1, moves.size // 200 + 1):
        if moves.size <= smaller + _MOVES:
            break
        band = float(moves[smaller])
        near = int(np.count_nonzero(moves <= 2.0 * band)) - smaller
        if band > _DIGITS * rounding and near > _MOVES and near > smaller / _EXCUSED:
            # a lattice written in decimals has moves of one step, and none of one and a half
            above = np.count_nonzero((moves > 1.5 * band) & (moves <= 2.0 * band))
            return band if 4 * repeats > near and 5 * above > near else 0.0
    return 0.0
