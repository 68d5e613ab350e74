"""Estimate the step in which a signal is written: the decimals of a file, or the resolution of a
transmitter or of OP.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_UNITS = 10.0 ** -np.arange(-3.0, 10.0)
# times the digits a column is written in, below which a spacing cannot be distinguished from these:
# a step of five digits can
_COARSER = 4.5
_OFF = 0.15  # of its spacing, by which a lattice's levels may be off it
# share of samples of values that occur once, below which they may be those that bridge holes
_BRIDGED = 0.01
_REPEATS = 20  # samples per level from which a lattice is plain
_BY_CHANCE = 1e-6  # probability that levels which lie anywhere are all as near to a lattice
# of the variance of a signal's moves; rounding that adds less is the archive's, and changes nothing
_IMMATERIAL = 0.005
_FEWEST_GAPS = 10  # for the mean length of the phases
# mean length of the phases; ten values that lie anywhere reach it three times in 10 000
_ON_LATTICE = 0.9


def resolution(x: np.ndarray) -> float:
    """Return the largest power of ten of which every value is a multiple."""
    # the first few values leave most units out
    for unit in _UNITS[_are_multiples(x[:20, None], _UNITS)]:
        if _are_multiples(x[:, None], unit)[0]:
            return float(unit)
    return 0.0


def _are_multiples(x: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Return of which units all values, shape (n, 1), are multiples."""
    scaled = x / units
    off = np.abs(scaled - np.rint(scaled))
    return (off < 1e-6 * np.maximum(1.0, np.abs(scaled) * 1e-6)).all(axis=0, keepdims=True).ravel()


def written_unit(x: np.ndarray, *others: np.ndarray) -> float:
    """Return the decimal unit a column is written in; one far coarser than its neighbours' digits
    is the signal's lattice.
    """
    unit = resolution(x)
    places = _places_before_point(x)
    finest = max([_digits_of(o) for o in others], default=0.0)
    if unit > 0.0 and finest >= places - np.log10(unit) + 2.0:
        if finest < 15.0:
            return 10.0 ** (places - finest)
        return 0.0
    return unit


def lattice(x: np.ndarray, unit: float = 0.0) -> float:
    """Return the spacing of the lattice, wherever it begins, on which all values of a signal stand.

    A transmitter counts from the lower end of its range: its lattice need not hold 0. It may have
    been written down on a finer one: its levels are then a little off, each always by the same. Not
    for a file's decimals: a transmitter of the same step cannot be distinguished from them.
    """
    # Levels that occur once were bridged, where they are few
    levels, count = np.unique(x, return_counts=True)
    once = count == 1
    if once.sum() < _BRIDGED * x.size:
        levels = levels[~once]
        count = count[~once]

    # The spacing of neighbours, from the narrowest on
    fine = unit + 1e-8 * (float(max(-levels[0], levels[-1])) or 1.0)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1.5 * fine]
    if gaps.size == 0 or gaps.min() < _COARSER * fine:
        return 0.0
    step = float(gaps.min())
    near = gaps[gaps < 3.5 * step]
    step = float(near.sum() / np.round(near / step).sum())
    repeats = count.sum() >= _REPEATS * levels.size
    if levels.size < 3:
        return step if repeats else 0.0

    # Spacing and beginning together, by least squares
    place = levels - levels[0]
    for _ in range(3):
        # spacing and beginning sharpen each other
        number = np.round(place / step)
        off = number - number.mean()
        square = off @ off
        if square > 0.0:
            step = float(off @ place / square)
        else:
            step = 0.0
        if step <= 0.0:
            return 0.0
        place = place - (place.mean() - step * number.mean())

    # Every level near the lattice, and that not by chance
    off = float(np.abs(place - step * np.round(place / step)).max())
    if off > _OFF * step + 0.6 * fine:
        return 0.0
    chance = min(2.0 * (off + fine) / step, 1.0) ** (levels.size - 2)
    if repeats or chance < _BY_CHANCE:
        return float(step)
    return 0.0


def root_lattice(x: np.ndarray) -> float:
    """Return the step, at the signal's mean, of the lattice on which its square lies.

    A flow is the square root of the differential pressure that was digitised. The levels' phases
    over one step are put on a circle (Rayleigh's test): for values that lie anywhere their mean is
    about 1/sqrt(levels) long, on a lattice 1.
    """
    levels = np.unique(x)
    size = np.abs(levels)
    slope = 2.0 * float(size.mean())
    # the unit of the largest values: files keep digits, not decimals
    large = size >= 10.0 ** np.floor(np.log10(max(float(size.max()), 1e-300)))
    return _step_anywhere(levels * size, resolution(levels[large]) * slope) / (slope or 1.0)


def hides_nothing(step: float, x: np.ndarray, noise: float = 0.0) -> bool:
    """Return whether rounding to a step adds next to nothing to a signal's moves, or to those of
    its noise unfiltered.
    """
    return step**2 / 12.0 < _IMMATERIAL * max(float(np.var(np.diff(x))), 2.0 * noise**2)


class Written(NamedTuple):
    """How a column is written: its decimal `unit`, its lattice's `step`, and `digits`, the larger
    of both that hides nothing.

    Each is in units of the column, and 0 where there is none.
    """

    unit: float
    step: float
    digits: float

    @property
    def coarse(self) -> float:
        """Step of a lattice that hides something of the signal's moves."""
        return 0.0 if self.step == self.digits else self.step


def read_lattice(x: np.ndarray, *others: np.ndarray) -> Written:
    """Return the digits and the lattice of a column, and which of the two only tells how the file
    was written.
    """
    unit = written_unit(x, *others)
    step = lattice(x, unit)
    return Written(unit, step, step if step > 0.0 and hides_nothing(step, x) else unit)


def _step_anywhere(levels: np.ndarray, unit: float) -> float:
    """Return the step of the lattice on which nearly all levels stand."""
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1.5 * unit]
    if gaps.size < _FEWEST_GAPS:
        return 0.0
    gaps = np.sort(gaps)
    small = gaps[: np.searchsorted(gaps, 1.5 * gaps[gaps.size // 20], side="right")]
    step = float(small[small.size // 2])
    for reach in (4.0, 40.0, np.inf):
        near = gaps[: np.searchsorted(gaps, reach * step)]
        step = float(near.sum() / np.rint(near / step).sum())
        # a few levels in the middle tell most signals that stand on none
        if _phase_length(levels[levels.size // 2 :][:16], step) < 0.6:
            return 0.0
    return step if _phase_length(levels, step) > _ON_LATTICE and step > 2.0 * unit else 0.0


def _phase_length(levels: np.ndarray, step: float) -> float:
    """Return the length of the mean phase of levels over a step: 1 on a lattice."""
    return float(abs(np.exp((2j * np.pi / step) * (levels - levels[0])).mean()))


def _places_before_point(x: np.ndarray) -> float:
    return float(np.floor(np.log10(max(float(np.abs(x).max()), 1e-12)))) + 1.0


def _digits_of(x: np.ndarray) -> float:
    unit = resolution(x)
    if unit > 0.0:
        return _places_before_point(x) - float(np.log10(unit))
    return 16.0
