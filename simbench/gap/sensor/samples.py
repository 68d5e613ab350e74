"""What single samples tell of the sensor and the archive: lattices, straight lines, spikes, holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter
from scipy.special import gammaln

SPIKE = 6.0  # robust standard deviations from which an isolated point is a spike
FURTHER = 4.5  # the same where three spikes are sure: 2 in 100 000 by chance
ALONE = 2.0  # times the spread of its neighbours about their line; a corner has 1.5, a step 1.25
COARSER = 5.0  # times the digits a column is written in, below which a spacing is not told from these
OFF = 0.15  # of its spacing, by which a lattice's levels may be off it
REPEATS = 20  # samples per level from which a lattice is plain
BY_CHANCE = 1e-6  # probability that levels which lie anywhere are all as near to a lattice
IMMATERIAL = 0.005  # of the variance of a signal's moves; rounding that adds less is the archive's, and changes nothing
DEGREES = (2.5, 3.0, 4.0, 5.0, 7.0, 10.0)  # of freedom of Student's t that are tried for a noise with heavy tails
SELDOM = 1e-3  # standstills of a length that a record of noise has by chance; longer ones are none


@dataclass(frozen=True, eq=False)
class Samples:
    """Sample-level findings on PV.

    `resolution` is the decimal unit PV is written in (0 = full precision), `step` a lattice coarser than that (0 = none),
    `straight` the share of samples on a straight line with both neighbours, `spikes` the indices of isolated points,
    `heights` how far off they are, `held` the longest exact standstill in samples, `stuck` the share of samples in standstills
    longer than rounding and noise explain; `heavy` whether the largest samples are no spikes but the tails of the noise.
    """

    resolution: float
    step: float
    straight: float
    spikes: np.ndarray
    heights: np.ndarray
    held: int
    stuck: float
    heavy: bool = False


def inspect_samples(pv: np.ndarray, *others: np.ndarray) -> Samples:
    """Look at PV sample by sample.

    Parameters
    ----------
    pv : ndarray, shape (n,)
        As recorded.
    *others : ndarray
        Further columns of the same file; they show with how many digits it was written.

    Returns
    -------
    Samples

    Examples
    --------
    >>> found = inspect_samples(np.round(np.random.default_rng(0).standard_normal(500) / 0.3137) * 0.3137)
    >>> round(found.step, 6)
    0.3137
    """
    unit = written_unit(pv, *others)
    step = lattice(pv, unit)
    spikes, heights = isolated(pv, max(unit, step))
    heavy = spikes.size > 0 and heavy_tails(_off_line(np.asarray(pv, dtype=float))[0])
    if heavy:
        spikes, heights = spikes[:0], heights[:0]
    return Samples(
        unit,
        step,
        float(np.mean(on_line(pv, unit))) if step == 0.0 else 0.0,
        spikes,
        heights,
        longest_hold(pv),
        stuck(pv, unit),
        heavy,
    )


def resolution(x: np.ndarray) -> float:
    """Return the largest power of ten of which every value is a multiple, 0 when the numbers are not rounded."""
    for digits in range(-3, 10):
        unit = 10.0**-digits
        scaled = x / unit
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-6 * np.maximum(1.0, np.abs(scaled) * 1e-6)):
            return unit
    return 0.0


def written_unit(x: np.ndarray, *others: np.ndarray) -> float:
    """Return the decimal unit a column is written in; one far coarser than its neighbours' digits is the signal's own lattice.

    Parameters
    ----------
    x : ndarray, shape (n,)
    *others : ndarray
        Other columns of the same file.

    Returns
    -------
    float
        0 when the numbers are not rounded.
    """
    unit = resolution(x)
    places = _places(x)
    finest = max([_digits(o) for o in others], default=0.0)
    if unit > 0.0 and finest >= places - np.log10(unit) + 2.0:
        return 10.0 ** (places - finest) if finest < 15.0 else 0.0
    return unit


def _places(x: np.ndarray) -> float:
    return float(np.floor(np.log10(max(float(np.abs(x).max()), 1e-12)))) + 1.0


def _digits(x: np.ndarray) -> float:
    unit = resolution(x)
    return _places(x) - float(np.log10(unit)) if unit > 0.0 else 16.0


def lattice(x: np.ndarray, unit: float) -> float:
    """Return the spacing of the lattice, wherever it begins, on which all values stand; 0 when none is coarser than `unit`.

    A lattice may have been written down on a finer one: its levels are then a little off, each always by the same.
    """
    levels = np.unique(x)
    fine = unit + 1e-8 * (float(np.abs(levels).max()) or 1.0)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1.5 * fine]
    if gaps.size == 0 or gaps.min() < COARSER * fine:
        return 0.0
    step = float(gaps.min())
    near = gaps[gaps < 3.5 * step]
    step = float(near.sum() / np.round(near / step).sum())
    repeats = x.size >= REPEATS * levels.size
    if levels.size < 3:
        return step if repeats else 0.0
    place = levels - levels[0]
    for _ in range(3):
        # spacing and beginning sharpen each other
        step, start = np.linalg.lstsq(np.column_stack([np.round(place / step), np.ones(place.size)]), place, rcond=None)[0]
        place = place - start
        if step <= 0.0:
            return 0.0
    off = float(np.abs(place - step * np.round(place / step)).max())
    if off > OFF * step + 0.6 * fine:
        return 0.0
    chance = min(2.0 * (off + fine) / step, 1.0) ** (levels.size - 2)
    return float(step) if repeats or chance < BY_CHANCE else 0.0


def hides_nothing(step: float, x: np.ndarray) -> bool:
    """Return whether rounding to a step adds next to nothing to a signal's moves."""
    return step**2 / 12.0 < IMMATERIAL * float(np.var(np.diff(x)))


def on_line(x: np.ndarray, unit: float) -> np.ndarray:
    """Return which samples, moving at all, lie on a line through their neighbours."""
    out = np.zeros(x.size, dtype=bool)
    first, second = np.diff(x), np.diff(x, 2)
    moving = (np.abs(first[1:]) > 2 * unit) | (np.abs(first[:-1]) > 2 * unit)
    typical = 1.4826 * float(np.median(np.abs(first)))
    tolerance = max(2.1 * unit, 1e-6 * (float(np.ptp(x)) or 1.0))
    if tolerance <= 0.2 * typical:
        out[1:-1] = moving & (np.abs(second) <= tolerance)
    return out


def isolated(x: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray]:
    """Return indices and signed heights of isolated one-sample spikes.

    A spike stands off the line through its four neighbours by far more than they stand off it themselves (a corner, a step
    and a bend do not), and by far more than samples do at this time (those of a burst of noise do not). The largest are taken
    out first, so that one does not hide the next; where three are sure, smaller ones are believed as well.
    """
    if x.size < 20:
        return np.empty(0, dtype=int), np.empty(0)
    found: dict[int, float] = {}
    clean = np.asarray(x, dtype=float).copy()
    usual = np.abs(_off_line(clean)[0])
    floor = max(0.5 * unit, 1e-12)
    overall = max(1.4826 * float(np.median(usual)), floor)
    # beyond what is usual now, at the edge of a burst of noise too
    now = maximum_filter1d(median_filter(usual, 31, mode="reflect"), 31)
    local = FURTHER * np.maximum(1.4826 * now, floor)
    for _ in range(10):
        off, near = _off_line(clean)
        size = np.abs(off)
        least = np.maximum((SPIKE if len(found) < 3 else FURTHER) * overall, local)
        hit = (size > least) & (size > ALONE * near)
        # of spikes that touch, only the larger is sure
        new = {int(k): float(off[k]) for k in np.flatnonzero(hit & (size >= maximum_filter1d(size, 5)))}
        if not new and len(found) >= 3:
            new = _touching(clean, least)
        if not new:
            break
        for k, height in new.items():
            found[k] = found.get(k, 0.0) + height
            clean[k] -= height
    order = sorted(found)
    return np.array(order, dtype=int), np.array([found[k] for k in order])


def heavy_tails(x: np.ndarray) -> bool:
    """Return whether Student's t is likelier than Gaussian samples among which some are far wider.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Samples about 0.

    Returns
    -------
    bool
    """
    scale = 1.4826 * float(np.median(np.abs(x)))
    if scale == 0.0:
        return False
    z2 = (x / scale) ** 2
    t = max(_loglik_t(z2, df) for df in DEGREES)
    share, narrow, wide, mixture = 0.02, 1.0, float(np.quantile(z2, 0.99)) + 1.0, 0.0
    for _ in range(30):
        far = share * np.exp(-0.5 * z2 / wide) / np.sqrt(wide)
        near = (1.0 - share) * np.exp(-0.5 * z2 / narrow) / np.sqrt(narrow)
        odds = far / (far + near + 1e-300)
        share = float(np.clip(odds.mean(), 1e-6, 0.5))
        wide = max(float(odds @ z2 / max(odds.sum(), 1e-12)), narrow)
        narrow = float((1.0 - odds) @ z2 / (1.0 - odds).sum())
        mixture = float(np.log(far + near + 1e-300).sum()) - 0.5 * z2.size * np.log(2.0 * np.pi)
    return t > mixture


def _loglik_t(z2: np.ndarray, df: float) -> float:
    """Return the log-likelihood of Student's t at its likeliest scale."""
    variance = 1.0
    for _ in range(20):
        variance = float(np.mean((df + 1.0) * z2 / (df + z2 / variance)))
    whole = gammaln((df + 1.0) / 2) - gammaln(df / 2) - 0.5 * np.log(np.pi * df * variance)
    return float(z2.size * whole - 0.5 * (df + 1.0) * np.log1p(z2 / (df * variance)).sum())


def _touching(x: np.ndarray, least: np.ndarray) -> dict[int, float]:
    """Return the heights of two spikes, one or two samples apart, each of which hides the other; empty when there are none."""
    off = np.abs(_off_line(x)[0])
    out: dict[int, float] = {}
    for k in np.flatnonzero(off > least):
        for apart in (1, 2):
            both = np.array([k, k + apart])
            at = np.setdiff1d(np.arange(k - 2, k + apart + 3), both)
            if at[0] < 0 or at[-1] >= x.size or any(j in out for j in at) or any(j in out for j in both):
                continue
            line = np.polyfit(at - k, x[at], 1)
            heights = x[both] - np.polyval(line, both - k)
            spread = float(np.ptp(x[at] - np.polyval(line, at - k)))
            if np.all(np.abs(heights) > np.maximum(least[both], ALONE * spread)):
                out |= dict(zip(both.tolist(), heights.tolist(), strict=True))
    return out


def _off_line(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far each sample is off the line through its four neighbours, and how far these spread about it."""
    # reflected oddly, a slope goes on straight beyond the ends
    padded = np.pad(x, 2, mode="reflect", reflect_type="odd")
    around = np.stack([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]])
    at = np.array([-2.0, -1.0, 1.0, 2.0])[:, None]
    middle, slope = around.mean(axis=0), (at * around).sum(axis=0) / 10.0
    return x - middle, np.ptp(around - middle - slope * at, axis=0)


def longest_hold(x: np.ndarray) -> int:
    """Return the longest run of exactly equal samples."""
    change = np.flatnonzero(np.diff(x) != 0.0)
    edges = np.concatenate([[-1], change, [x.size - 1]])
    return int(np.diff(edges).max())


def stuck(x: np.ndarray, unit: float) -> float:
    """Return the share of samples in exact standstills longer than noise, rounded to `unit`, has by chance."""
    change = np.diff(x)
    blocks = [b[b != 0.0] for b in np.array_split(change, max(x.size // 50, 1))]
    moving = [1.4826 * float(np.median(np.abs(b))) for b in blocks if b.size >= 10]
    if len(moving) < 0.7 * len(blocks):
        return 0.0
    # the quietest tenth of the record says how often two neighbours agree
    agree = unit / (2.5 * float(np.quantile(moving, 0.1)))
    if agree > 0.5:
        return 0.0
    longest = 1.0 + np.log(SELDOM / x.size) / np.log(max(agree, 1e-9))
    edges = np.concatenate([[-1], np.flatnonzero(change != 0.0), [x.size - 1]])
    runs = np.diff(edges)
    return float(runs[runs > max(longest, 4.0)].sum() / x.size)


def cleaned(x: np.ndarray, spikes: np.ndarray) -> np.ndarray:
    """Return the signal with the spikes replaced by the line between their neighbours."""
    if spikes.size == 0:
        return x
    keep = np.ones(x.size, dtype=bool)
    keep[spikes] = False
    at = np.arange(x.size)
    return np.interp(at, at[keep], x[keep])
