"""Loops of a grid, and the same loops once effects found in a plant have joined them, one after the other."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from detectors.errors import UserError
from detectors.record import LoopRecord
from detectors.verdict import STICTION
from scenarios.errors import SpecError
from scenarios.grid import load_grid
from scenarios.spec import Loop
from simbench.bench.resolve import resolve
from simbench.loop.simulate import simulate
from simbench.plant.indices import judged
from simbench.plant.looks import by_unit, looks
from simbench.plant.strengths import Size, absolute, with_effect
from simbench.plant.study_result import Contribution
from simbench.plant.two_sample import Ruler, mmd

LEAST = 2  # loops in which an effect must be found to be tried
MOST = 5  # effects joined one after the other


@dataclass(frozen=True, eq=False)
class Simulated:
    """One loop of the grid: its group, the loop, its record and whether it is sticky.

    `stands` for its group in distances: a plant's unit is one loop, not the mean of a loop and its healthy sibling.
    """

    unit: str
    loop: Loop
    seed: int
    record: LoopRecord
    sticky: bool
    size: Size
    stands: bool = True


def draw(grid: str | Path, groups: int, seed: int) -> list[Simulated]:
    """Simulate all loops of some groups of a grid.

    Parameters
    ----------
    grid : str or path
    groups : int
    seed : int
        Of their choice.

    Returns
    -------
    list of Simulated
    """
    source = load_grid(grid)
    rng = np.random.default_rng([seed, 1])
    order = rng.permutation(source.group_count)[:groups]
    out = []
    for index in tqdm(order, file=sys.stderr, desc="grid"):
        try:
            members = list(resolve(source.group(int(index))))
            pick = int(rng.integers(len(members)))
            for i, s in enumerate(members):
                run = simulate(s.loop, s.seed)
                record = run.record.blind()
                out.append(Simulated(str(index), s.loop, s.seed, record, run.sticky, Size.of(record), i == pick))
        except (UserError, SpecError):
            continue
    return out


def join(
    simulated: list[Simulated],
    found: Mapping[str, list[dict[str, Any]]],
    loops: int,
    ruler: Ruler,
    real_x: np.ndarray,
    base: np.ndarray,
    methods: list[str],
    rng: np.random.Generator,
) -> tuple[list[Contribution], dict[str, float]]:
    """Join effects to the grid one after the other, the one that closes most of the distance first.

    Parameters
    ----------
    simulated : list of Simulated
    found : mapping of effect to list of dict
        Relative strengths, one per unit that has it.
    loops : int
        Real units.
    ruler : Ruler
    real_x : ndarray, shape (loops, features)
    base : ndarray, shape (simulated, methods)
        Verdicts on the grid as it is.
    methods : list of str
    rng : numpy.random.Generator

    Returns
    -------
    list of Contribution
    dict of str to float
        Accuracy of every method once all have joined.
    """
    left = {e: s for e, s in found.items() if len(s) >= LEAST}
    now, out = simulated, []
    before = accuracy(simulated, base, methods)
    so_far, nearest = before, mmd(ruler, units(simulated), real_x)
    while left and len(out) < MOST:
        tried = {e: _with(now, e, strengths, len(strengths) / loops, rng) for e, strengths in left.items()}
        far = {e: mmd(ruler, units(s), real_x) for e, s in tried.items()}
        best = min(far, key=lambda e: far[e])
        if far[best] >= nearest:
            break
        nearest = far[best]
        only = tried[best] if now is simulated else _with(simulated, best, left[best], len(left[best]) / loops, rng)
        reached = accuracy(only, verdicts_on(only, methods), methods)
        alone = {m: reached[m] - before[m] for m in methods}
        after = reached if now is simulated else accuracy(tried[best], verdicts_on(tried[best], methods), methods)
        change = {m: after[m] - so_far[m] for m in methods}
        out.append(Contribution(best, len(left[best]) / loops, far[best], alone, change, tuple(left[best])))
        now, so_far = tried[best], after
        del left[best]
    return out, so_far


def _with(
    simulated: list[Simulated], effect: str, strengths: list[dict[str, Any]], share: float, rng: np.random.Generator
) -> list[Simulated]:
    """Return the grid's loops with an effect in a share of its units, of strengths found on real loops."""
    hit = {u: rng.random() < share for u in dict.fromkeys(s.unit for s in simulated)}
    drawn = {u: strengths[int(rng.integers(len(strengths)))] for u in hit}
    out = []
    for s in simulated:
        if hit[s.unit]:
            try:
                loop = with_effect(s.loop, effect, absolute(effect, drawn[s.unit], s.size))
                s = replace(s, loop=loop, record=simulate(loop, s.seed).record.blind())
            except (UserError, SpecError):
                pass
        out.append(s)
    return out


def units(simulated: list[Simulated]) -> np.ndarray:
    """Return the features of the loops that stand for their groups, shape (groups, features)."""
    standing = [s for s in simulated if s.stands]
    return by_unit([looks(s.record) for s in standing], [s.unit for s in standing])[1]


def verdicts_on(simulated: list[Simulated], methods: list[str]) -> np.ndarray:
    """Return 1 for stiction, 0 for no stiction, NaN for no decision, shape (loops, methods)."""
    code = {STICTION: 1.0, "no_stiction": 0.0}
    return np.array([[code.get(v.verdict, np.nan) for v in judged(s.record, methods)] for s in simulated])


def accuracy(simulated: list[Simulated], verdicts: np.ndarray, methods: list[str]) -> dict[str, float]:
    """Return the mean of the shares right of sticky and of healthy loops, by method; no decision is not right.

    Parameters
    ----------
    simulated : list of Simulated
    verdicts : ndarray, shape (loops, methods)
    methods : list of str

    Returns
    -------
    dict of str to float
    """
    truth = np.array([float(s.sticky) for s in simulated])
    right = verdicts == truth[:, None]
    # a grid that is more sticky than healthy must not reward those who say so
    share = 0.5 * (right[truth > 0].mean(axis=0) + right[truth == 0].mean(axis=0))
    return dict(zip(methods, share.tolist()))
