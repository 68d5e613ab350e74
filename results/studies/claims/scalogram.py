"""Scalograms and a linear head: do pictures of the wavelet transform carry what indices of the
waveform's shape do not?

A ridge on the pooled magnitudes of the transform of OP and PV, and a ridge on the scores of the
package's methods, learned and judged on the same loops; then both together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from results.studies.claims.judged import CANNOT_TELL, NO, YES, Answers, Claim, Loops, counted
from results.studies.learned import JUDGE, LEARN, PERIODS, POINTS, loops, ridge, window_of
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord

LEARNED, ASKED = 1200, 600  # simulated loops of grid chapter, of two seeds
SCALES, TIMES = 24, 8  # pooled picture of each signal: frequencies, and one column a period
LOWEST, HIGHEST = 0.5, 10.0  # of the loop's own frequency; half the sampling is 12
_OMEGA = 6.0  # of Morlet's wavelet (-)


@dataclass(frozen=True)
class Views:
    """What the three classifiers see of loops that last long enough; shape (m, ...)."""

    picture: np.ndarray
    shape: np.ndarray
    sticky: np.ndarray
    group: np.ndarray
    missing: np.ndarray  # of loops that are too short: whether the valve sticks


def scalogram(window: np.ndarray) -> np.ndarray:
    """Return the pooled magnitude of Morlet's wavelet transform of both signals, shape (2 * 24 *
    8,).
    """
    n = window.shape[1]
    f = np.fft.fftfreq(n) * POINTS  # in units of the loop's own frequency
    centres = np.geomspace(LOWEST, HIGHEST, SCALES)
    bands = np.exp(-0.5 * (_OMEGA * (f / centres[:, None] - 1.0)) ** 2) * (f > 0.0)
    spectra = np.fft.fft(window)[:, None] * bands
    pooled = np.abs(np.fft.ifft(spectra)).reshape(len(window), SCALES, TIMES, -1).mean(axis=3)
    return np.log(pooled + 1e-3).ravel()


def shape_methods() -> list[str]:
    """Return the fast methods that need no valve position and were fitted to no grid."""
    known = ((name, registry.load(name).METHOD) for name in registry.names())
    return [
        name
        for name, m in known
        if m.budget == "fast" and not m.needs_mv and not m.fitted_on and m.role == "stiction"
    ]


def indices(record: LoopRecord, names: Sequence[str]) -> list[float]:
    """Return the score of every method; 0 where it has none."""
    return [float(np.nan_to_num(v.score)) for v in judge(record, names)]


def views(records: Sequence[LoopRecord], sticky: np.ndarray, group: np.ndarray) -> Views:
    """Return what is seen of loops."""
    names, pictures, shapes, kept = shape_methods(), [], [], []
    for record in records:
        oscillation = prepare(record).oscillation
        period = oscillation.period_s / record.Ts if oscillation.sustained else 0.0
        window = window_of(record.op, record.pv, period) if period else None
        kept.append(window is not None)
        if window is not None:
            pictures.append(scalogram(window))
            shapes.append(indices(record, names))
    there = np.array(kept, dtype=bool)
    return Views(np.array(pictures), np.array(shapes), sticky[there], group[there], sticky[~there])


def rows(data: Sequence[Loops]) -> list[tuple[str, ...]]:
    """Return a line for each view on each kind of loops: learned on grid chapter, and on recorded
    loops also on those of all other contributors.
    """
    taught = loops("chapter", LEARN, LEARNED)
    asked = loops("chapter", JUDGE, ASKED)
    known = views(taught.records, taught.cycling, np.zeros(len(taught.records)))
    chapter = Loops("chapter", asked.records, asked.cycling, np.zeros(len(asked.records)))
    table = []
    for of in (chapter, *data):
        here = views(of.records, of.sticky, of.group)
        for name, see in VIEWS.items():
            score = ridge().fit(see(known), known.sticky).decision_function(see(here))
            table.append(_row(name, of, here, score))
        if of.name == "recorded":
            table += [
                _row(f"{name}, from other contributors", of, here, _left_out(see(here), here))
                for name, see in VIEWS.items()
            ]
    return table


VIEWS = {
    "scalogram": lambda v: v.picture,
    "shape indices": lambda v: v.shape,
    "both": lambda v: np.hstack([v.picture, v.shape]),
}


def _left_out(x: np.ndarray, here: Views) -> np.ndarray:
    """Return the scores of loops by classifiers that were learned on all other groups."""
    score = np.zeros(len(x))
    for group in np.unique(here.group):
        out = here.group == group
        score[out] = ridge().fit(x[~out], here.sticky[~out]).decision_function(x[out])
    return score


def _row(name: str, of: Loops, here: Views, score: np.ndarray) -> tuple[str, ...]:
    """Return a line; loops that are too short get no answer."""
    said = np.concatenate([np.where(score > 0.0, YES, NO), np.full(here.missing.size, CANNOT_TELL)])
    answers = Answers(np.concatenate([score, np.full(here.missing.size, np.nan)]), said)
    sticky = np.concatenate([here.sticky, here.missing])
    return counted(name, Loops(of.name, of.records, sticky, of.group), answers)


CLAIM = Claim(
    claimed=(
        "scalograms of OP and PV keep what indices of the shape lose, and a network detects"
        " stiction from them; Hybrid wavelet-CNN framework (2026), Actuators 15, 249 (abstract,"
        " without a figure)"
    ),
    protocol=(
        f"last {PERIODS} periods at {POINTS} points, standardised; |Morlet transform| at {SCALES}"
        f" frequencies by {TIMES} periods of both signals; learned on {LEARNED} loops of grid"
        f" chapter (seed {LEARN}), asked on {ASKED} others (seed {JUDGE})"
    ),
    stand_in="a ridge in place of a deep residual network: it shows what a linear head finds there",
    rows=rows,
)
