"""What a record tells without its waveform, and the reference method `no_waveform` that knows
nothing else.

A method that finds stiction must beat it. One list for the reference row of the score table and for
the study of what grids give away (`python -m results.studies.leak`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.autocorrelation import centred
from simbench.detectors.signal.conditioning import median

if TYPE_CHECKING:
    from simbench.bench.store.reading import RunArrays
from functools import lru_cache

from simbench.detectors.compiled import one_thread

# No quotient here says how a wave looks: no extreme and no single value of a signal over its std.
FEATURE_SETS = {
    # of the record and the loop: integrating 1, self-regulating 0
    "sampling": ("samples_per_period", "periods", "n", "Ts", "integrating"),
    "set point": ("sp_steps", "sp_span"),  # its changes, and its range over the std of PV
    "digits": (
        "op_repeats",
        "pv_repeats",
        "op_values",
        "pv_values",
    ),  # shares of repeated and of different values
    "amplitude": ("op_std", "pv_std"),
    # means and first values; error and drift (mean of the last fifth less that of the first) over
    # the std of PV and OP
    "offset and start": ("op_mean", "pv_mean", "error_mean", "op_first", "pv_first", "op_trend"),
    "noise level": ("op_noise", "pv_noise"),  # std of the noise over that of the signal
    "growth": (
        "op_begin",
        "op_end",
        "pv_begin",
        "pv_end",
    ),  # std of the first and the last fifth over that of the whole
}
# asked one at a time: two of them, or one with a std, tell how a wave looks
EXTREMES = ("op_max", "op_min", "pv_max", "pv_min")
FEATURES = tuple(name for names in FEATURE_SETS.values() for name in names)
_FIFTH = 5
_SMALLEST = 1e-12  # std (% or PV units) of a signal that stands still
# std of white noise over the median of its absolute fourth difference: of 1, -4, 6, -4, 1 the
# squares sum to 70, and the median of a normal variable's size is 0.6745 of its std. Of a wave of
# 20 samples or more a fourth difference leaves less than 0.01.
_NOISE_SCALE = 1.0 / (0.6745 * 70.0**0.5)


def features_without_waveform(record: LoopRecord, period_s: float) -> np.ndarray:
    """Return `FEATURES` and then `EXTREMES` of a record.

    `period_s` is that of its oscillation, NaN where there is none: then it has 0 samples per period
    and 0 periods.
    """
    # The signals, and the period where there is one
    op = record.op
    pv = record.pv
    if record.sp is None:
        sp = np.full(record.n, pv.mean())
    else:
        sp = record.sp
    fifth = max(record.n // _FIFTH, 2)
    oscillates = np.isfinite(period_s)
    if oscillates:
        period = period_s / record.Ts
    else:
        period = 0.0

    # Features of each signal, then of both
    of_op = _features_of_signal(op, fifth)
    of_pv = _features_of_signal(pv, fifth)
    values = {f"op_{name}": value for name, value in of_op.items()} | {
        f"pv_{name}": value for name, value in of_pv.items()
    }
    values.update(
        samples_per_period=period,
        periods=record.n / period if oscillates else 0.0,
        n=record.n,
        Ts=record.Ts,
        integrating=float(record.process == "integrating"),
        sp_steps=float(np.count_nonzero(np.diff(sp))),
        sp_span=float(np.ptp(sp)) / max(of_pv["std"], _SMALLEST),
        error_mean=float(np.mean(sp - pv)) / max(of_pv["std"], _SMALLEST),
    )

    # In the order of their names
    return np.array([values[name] for name in FEATURES + EXTREMES])


def _features_of_signal(x: np.ndarray, fifth: int) -> dict[str, float]:
    # Scale, both ends of the record, and the levels in order
    std = centred(x)[1]
    unit = max(std, _SMALLEST)
    begin = x[:fifth]
    end = x[-fifth:]
    levels = np.sort(x)

    # Each feature in units of the standard deviation, where it has one
    return {
        "std": std,
        "mean": float(np.mean(x)),
        "first": float(x[0]),
        "max": float(levels[-1]),
        "min": float(levels[0]),
        "repeats": np.count_nonzero(x[1:] == x[:-1]) / (x.size - 1),
        "values": (1 + np.count_nonzero(levels[1:] != levels[:-1])) / x.size,
        "noise": _NOISE_SCALE * median(np.abs(np.diff(x, 4))) / unit if x.size > 4 else 0.0,
        "begin": centred(begin)[1] / unit,
        "end": centred(end)[1] / unit,
        "trend": abs(float(np.mean(end) - np.mean(begin))) / unit,
    }


def is_told(book: RunArrays) -> bool:
    """Return whether a run was stored with what its records tell without their waveform."""
    return bool(book.design.any())  # every record has a length


def no_waveform(book: RunArrays, rhythm: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the probability of a cycle and the verdict (1 stiction) of a classifier on `FEATURES`,
    with `rhythm` on `RHYTHM` as well, for every scenario, and which scenarios it knows.

    It is asked about loops that oscillate: of others the probability is -inf and the verdict 0, as
    of every method after the oscillation detection. It learns from the loops of other groups; where
    the truth is not clear it knows nothing, .5. Of a large run it knows the sample alone.
    """
    asked = np.zeros(book.groups.size, dtype=bool)
    asked[sample_of(book.groups)] = True
    known = asked & book.oscillating & ~book.apart & (book.truth["cycled"] >= 0)
    chance = np.where(book.oscillating, 0.5, -np.inf)
    features = book.design[:, : len(FEATURES)]
    if rhythm:
        more = book.design[:, len(FEATURES) + len(EXTREMES) :]
        features = np.concatenate([features, more], axis=1)
    chance[known] = out_of_fold(
        features[known], book.truth["cycled"][known] == 1, book.groups[known]
    )
    return chance, (chance > 0.5).astype(np.int8), asked


# --- What is learned on some groups of loops and judged on the others: thresholds, and the
# probability of a label.

# scenarios; the 95 % interval of an area under a curve is then about .01 wide
MOST_ORDERED = 20_000
_FOLDS = 5
_ALARMS = 0.05  # share of false positives at which sensitivity_at_5 is taken
_LEAST = 100  # loops below which gradient boosting has nothing to split
# trees, and leaves of each: with twice the trees of four times the leaves the AUC of 12 sets of
# loops is .54 as well, where noise is asked for .998, and it takes four times as long
_TREES = 50
_LEAVES = 8
_MOST = 5_000  # loops that it learns from; of more these are drawn at random


def sample_of(groups: np.ndarray) -> np.ndarray:
    """Return the loops on which orders and scatter are worked out: all, of a large run those of
    groups drawn at random, `MOST_ORDERED` or a few more.
    """
    place = np.unique(groups, return_inverse=True)[1]
    sizes = np.bincount(place)
    order = np.random.default_rng(0).permutation(sizes.size)
    kept = np.empty(sizes.size, dtype=bool)
    kept[order] = np.cumsum(sizes[order]) - sizes[order] < MOST_ORDERED
    return np.flatnonzero(kept[place])


def folds_of(groups: np.ndarray) -> np.ndarray:
    """Return a fold (0 to 4) for every loop; groups stay whole."""
    unique, place = np.unique(groups, return_inverse=True)
    return np.random.default_rng(0).permutation(unique.size)[place] % _FOLDS


def found_at(
    ranks: np.ndarray, positive: np.ndarray, fold: np.ndarray, alarms: float = _ALARMS
) -> int:
    """Count positives above a threshold that lets so many false positives through on the other
    folds.
    """
    found = 0
    for k in range(_FOLDS):
        healthy = ranks[(fold != k) & ~positive]
        # nothing to learn a threshold from: nothing is found
        cut = ranks.max(initial=0)
        if healthy.size:
            place = healthy.size - 1 - int(alarms * healthy.size)
            cut = np.partition(healthy, place)[place]
        found += int((ranks[(fold == k) & positive] > cut).sum())
    return found


def out_of_fold(features: np.ndarray, label: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return the probability of a label by gradient boosting on one thread, learned on other groups
    than it is asked about.
    """
    arrays = (np.asarray(features, float), label > 0, folds_of(groups))
    return _boost_folds(features.shape[1], *(x.tobytes() for x in arrays)).copy()


# `run` scores what it wrote, and then what it reads: the two classifiers learn once
@lru_cache(maxsize=2)
def _boost_folds(
    columns: int, feature_bytes: bytes, label_bytes: bytes, fold_bytes: bytes
) -> np.ndarray:
    """Return what `out_of_fold` does, of folds, for arrays of floats, bools and integers."""
    # The arrays as they were before they became a key
    label = np.frombuffer(label_bytes, bool)
    fold = np.frombuffer(fold_bytes, int)
    features = np.frombuffer(feature_bytes).reshape(-1, columns)
    said = np.full(label.size, 0.5)
    learned = []

    # Each fold: the share of sticky loops elsewhere, or a model that is learned there
    for k in np.unique(fold):
        there = fold != k
        here = fold == k
        if there.any():
            said[here] = label[there].mean()
        if label.size >= _LEAST and 0 < label[there].sum() < there.sum():
            chosen = np.flatnonzero(there)
            if chosen.size > _MOST:
                chosen = np.sort(np.random.default_rng(0).choice(chosen, _MOST, replace=False))
            learned.append((chosen, here))

    # The models, one thread each
    if learned:
        # here, for it takes a second to load
        from sklearn.ensemble import HistGradientBoostingClassifier

        # two threads on a busy machine wait for each other for minutes
        with one_thread():
            for there, here in learned:
                model = HistGradientBoostingClassifier(
                    max_iter=_TREES, max_leaf_nodes=_LEAVES, random_state=0
                )
                model.fit(features[there], label[there])
                said[here] = model.predict_proba(features[here])[:, 1]
    return said
