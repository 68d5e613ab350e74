"""Adaptive runs: add seeds only to those cells of a grid in which the accuracy of some method is
still too uncertain (`run --until-width`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq

from simbench.bench.scenario.truth import NO, YES
from simbench.bench.statistics import wilson
from simbench.bench.store.checksums import TABLES, RunError
from simbench.bench.store.place import Place
from simbench.bench.store.reading import parts
from simbench.detectors.verdict import NO_STICTION, STICTION
from simbench.scenarios.grid import Grid

_MOST_REPEATS = 5000
_BLIND_REPEATS = 16  # a cell without a single yes or no by then never gets one
_PIECE = 80  # scenarios
NARROWEST = 0.001  # interval that may be asked for: four million trials


def check_width(width: float | None) -> None:
    """Raise RunError for a width that no interval can be asked to have."""
    number = isinstance(width, (int, float)) and not isinstance(width, bool)
    if width is not None and not (number and NARROWEST <= width < 1):
        raise RunError(f"until_width = {width}; a number between {NARROWEST} and 1 is needed")


def next_round(
    grid: Grid,
    place: Place,
    marks: dict[str, list[str]],
    width: float,
    methods: Sequence[str],
    extra: dict[str, Any],
) -> list[list[int]]:
    """Return the groups that the next round must add, cut in pieces; none when every cell is known
    well enough.
    """
    right, known, repeats = _counts(grid, place, marks, methods)
    widths = _widths(right, known)
    per_repeat = np.maximum(known, 1) / np.maximum(repeats, 1)
    blind = known == 0
    open_cells = np.where(blind, repeats < _BLIND_REPEATS, widths > width) & (
        repeats < _MOST_REPEATS
    )
    sizes = np.array([grid.size(cell) for cell in range(grid.cells)])
    extra["adaptive"] = {
        "width": width,
        "widest": float(widths[~blind].max()) if not blind.all() else None,
        "scenarios": int(repeats @ sizes),
        "full_product": int(repeats.max() * sizes.sum()),
        "open_cells": int(open_cells.sum()),
    }
    groups: list[int] = []
    for cell in np.flatnonzero(open_cells):
        lacking = (
            0
            if blind[cell]
            else trials(right[:, cell] / known[cell], known[cell], width) - known[cell]
        )
        # at most twice what there is: the estimate is rough while there is little
        more = int(np.clip(math.ceil(lacking / per_repeat[cell]), 1, max(repeats[cell], 1)))
        first = int(repeats[cell])
        groups += [
            r * grid.cells + int(cell) for r in range(first, min(first + more, _MOST_REPEATS))
        ]
    groups.sort()
    step = max(_PIECE // max(int(sizes.max()), 1), 1)
    return [groups[i : i + step] for i in range(0, len(groups), step)]


def trials(share: np.ndarray, tried: int, width: float) -> int:
    """Return how many trials Wilson's interval needs to be this narrow, for the most demanding of
    several shares.
    """
    p = (np.asarray(share) * tried + 1.0) / (tried + 2.0)
    hardest = float(p[np.argmin(np.abs(p - 0.5))])

    def excess(n: float) -> float:
        lo, hi = wilson(hardest * n, n)
        return float(hi - lo) - width

    return math.ceil(brentq(excess, 1e-3, 1e9))


def _widths(right: np.ndarray, known: np.ndarray) -> np.ndarray:
    lo, hi = wilson(right, np.broadcast_to(known, right.shape))
    return (hi - lo).max(axis=0)


def _counts(
    grid: Grid, place: Place, marks: dict[str, list[str]], methods: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    right = np.zeros((len(methods), grid.cells), dtype=int)
    known, repeats = np.zeros(grid.cells, dtype=int), np.zeros(grid.cells, dtype=int)
    sofar = {TABLES: marks}
    scenario_parts = parts(place, "scenarios", ["group", "cycled"], sofar)
    for scenarios, verdicts in zip(
        scenario_parts, parts(place, "verdicts", ["verdict"], sofar), strict=True
    ):
        group = scenarios.column("group").to_numpy()
        answer = np.array(scenarios.column("cycled").to_pylist())
        verdict = np.array(verdicts.column("verdict").to_pylist()).reshape(-1, len(methods)).T
        cell = group % grid.cells
        np.maximum.at(repeats, cell, group // grid.cells + 1)
        labelled = np.isin(answer, (YES, NO))
        np.add.at(known, cell[labelled], 1)
        good = verdict == np.where(answer == YES, STICTION, NO_STICTION)
        for i in range(len(methods)):
            np.add.at(right[i], cell[labelled], good[i, labelled])
    return right, known, repeats
