"""Make surrogate signals (same spectrum and values as a record, random phases) and compute the
nonlinearity index NPI from them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.compiled import compiled
from simbench.detectors.errors import ParameterError

_ITERATIONS = 10
_SAMPLES_PER_CYCLE = 10  # Thornhill 2005: 7 to 25
_CYCLES = 20  # at most; at least 12
_SURROGATES = 50
_NEIGHBOURS = 8
# of the variance: the surrogates of a clean cycle are themselves off by rounding in rank and
# spectrum
_LEAST_VARIANCE = 0.01


def end_matched(x: np.ndarray, period: float) -> np.ndarray:
    """Cut an oscillating signal so that its end continues in its beginning in value and slope.

    Source: Stam, Pijn & Pritchard (1998), Physica D 112, 361-380. Anything but a whole number of
    cycles leaks into the spectrum of every surrogate, and a linear cycle then looks nonlinear. The
    match is made over a whole cycle: in noise, value and slope of single samples pick any cut. Not
    for fewer than three periods.
    """
    p = min(round(period), x.size // 4)
    start = x[:p]
    # where, in the last cycle and a half, does the piece that follows look most like the beginning?
    ends = np.lib.stride_tricks.sliding_window_view(x[max(x.size - 5 * p // 2, p) :], p)
    k = int(np.argmin(((ends - start) ** 2).sum(axis=1)))
    return x[: max(x.size - 5 * p // 2, p) + k]


def iaaft(x: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw surrogate signals with the amplitude spectrum and the distribution of values of a
    signal.

    Source: Schreiber & Schmitz (1996), Phys. Rev. Lett. 77, 635-638. Plain amplitude-adjusted
    surrogates (one round) flatten the spectrum of a cycle and call a sine nonlinear; they are not
    offered. Not for signals that are not stationary.
    """
    values = np.sort(x)
    amplitude = np.abs(np.fft.rfft(x))
    phases = np.exp(2j * np.pi * rng.random((count, amplitude.size)))
    y = np.fft.irfft(np.fft.rfft(x) * phases, x.size, axis=1)
    ranked = np.empty_like(y)
    order = np.argsort(y, axis=1)
    for _ in range(_ITERATIONS):
        compiled(ranked_again)(y, order, values, ranked)
        spectrum = np.fft.rfft(ranked, axis=1)
        size = np.abs(spectrum)
        y = np.fft.irfft(spectrum * (amplitude / np.where(size > 0.0, size, 1.0)), x.size, axis=1)
    return ranked


def ranked_again(y, order, values, ranked):
    """Sort `order`, the indices of each row of `y`, and fill `ranked` with `values` in the order of
    `y`.

    By insertion: from one iteration to the next a row changes its order a little only.
    """
    # Insertion: the order of the last round is nearly right
    sorted_row = np.empty(values.size)
    for r in range(len(y)):
        for k in range(values.size):
            i = order[r, k]
            value = y[r, i]
            place = k
            while place > 0 and sorted_row[place - 1] > value:
                sorted_row[place] = sorted_row[place - 1]
                order[r, place] = order[r, place - 1]
                place -= 1
            sorted_row[place] = value
            order[r, place] = i
        for k in range(values.size):
            ranked[r, order[r, k]] = values[k]


def prediction_error(
    x: np.ndarray, embedding: int, horizon: int, neighbours: int = _NEIGHBOURS
) -> float:
    """Return the squared error when a signal is predicted by what followed its most similar earlier
    segments.

    Source: Thornhill (2005), IEEE Trans. Control Systems Technology 13, 434-443.
    """
    if neighbours < 1:
        raise ParameterError(f"prediction_error: neighbours = {neighbours}; at least 1 is needed")
    return float(
        compiled(prediction_errors)(np.ascontiguousarray(x), embedding, horizon, neighbours)
    )


@dataclass(frozen=True)
class _Npi:
    """The nonlinearity index NPI, and the cycles that it was computed from."""

    npi: float  # (mean surrogate error - error) / (3 std of surrogate errors); above 1 = nonlinear
    cycles: float


def nonlinearity_index(x: np.ndarray, period: float, seed: int = 0) -> _Npi:
    """Compare how well an oscillating signal is predictable from itself with how well its
    surrogates are.

    Source: Thornhill (2005), IEEE Trans. Control Systems Technology 13, 434-443: at least 12 cycles
    of 7 to 25 samples, embedding and horizon of one cycle, 8 neighbours, 50 surrogates. Here with
    iterated (iAAFT) surrogates. Own finding: a strict cycle of any shape keeps its harmonics, and
    so its predictability, in every surrogate; the index stays below 1 for squares and triangles
    alike. An index below 1 is no proof of a linear loop.
    """
    cycle = int(min(_SAMPLES_PER_CYCLE, period))

    # the end of the record, where transients have died; matched before it is thinned out: half a
    # sample of ten leaks
    x = end_matched(x[-int((_CYCLES + 2.5) * period) :], period)
    cycles = max(round(x.size / period), 1)
    total = np.concatenate([[0.0], np.cumsum(x)])
    x = np.diff(
        np.interp(np.linspace(0.0, x.size, cycles * cycle + 1), np.arange(total.size), total)
    )
    x = (x - x.mean()) / max(float(x.std()), 1e-300)
    error = prediction_error(x, cycle, cycle)
    others = []
    for y in iaaft(x, _SURROGATES, np.random.default_rng(seed)):
        others.append(prediction_error(y, cycle, cycle))
    spread = max(float(np.std(others, ddof=1)), _LEAST_VARIANCE * x.size)
    return _Npi((float(np.mean(others)) - error) / (3.0 * spread), float(cycles))


# --- Compute the prediction error of the detector `surrogate`: find for each segment of a signal
# its nearest segments, by comparing all pairs.
#
# The function also runs, slowly, as plain Python; `simbench.detectors.compiled.compiled` compiles
# it. A tree does not pay for a few hundred pieces of ten samples.


def prediction_errors(x, embedding, horizon, neighbours):
    """Return the squared error of predicting `x` from what followed the nearest look-alikes of each
    piece.

    Pieces of `embedding` samples that overlap are no look-alikes. Of look-alikes equally far, the
    last that fit all count.
    """
    # Room for the distances of all look-alikes
    m = x.size - horizon - embedding + 1
    far = np.empty(m)
    nearest = np.empty(neighbours)
    ahead = x[embedding - 1 + horizon :]
    total = 0.0

    # Squared distance of every stretch to this one; those that overlap it are none
    for i in range(m):
        far[:] = 0.0
        for t in range(embedding):
            here = x[i + t]
            there = x[t:]
            for j in range(m):
                far[j] += (here - there[j]) * (here - there[j])
        far[max(i - embedding + 1, 0) : i + embedding] = np.inf

        # The distance of the last neighbour, by insertion
        nearest[:] = np.inf  # the least distances, in order
        for j in range(m):
            if far[j] < nearest[neighbours - 1]:
                place = neighbours - 1
                while place > 0 and nearest[place - 1] > far[j]:
                    nearest[place] = nearest[place - 1]
                    place -= 1
                nearest[place] = far[j]

        # The mean of what followed the neighbours is the guess
        guess = count = 0.0
        for j in range(m):
            if far[j] <= nearest[neighbours - 1] and far[j] < np.inf:
                guess += ahead[j]
                count += 1.0
        if count > 0.0:
            total += (ahead[i] - guess / count) ** 2
    return total
