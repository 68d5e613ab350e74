"""Add effects observed in a plant to the loops of a grid, one after the other, the most useful
first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import STICTION
from simbench.loop.effects import EFFECTS, Choice
from simbench.loop.simulate import simulate
from simbench.plant.study.loop_features import by_unit, looks
from simbench.plant.study.result import Contribution
from simbench.plant.study.strengths import FRICTION_EFFECT, Size, absolute, with_effect
from simbench.plant.study.two_sample import FeatureScaler, mmd_squared
from simbench.progress import Progress
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Loop, Part

_FEWEST_LOOPS = 2  # loops in which an effect must be diagnosed to be tried
_MOST_EFFECTS = 5  # effects joined one after the other
_ROUNDS = 4  # in which a strength is measured again by the loop that has it


@dataclass(frozen=True, eq=False)
class Simulated:
    """One loop of the grid: its group, the loop, its record and whether it is sticky.

    Distances take the `representative` loop of each group: a plant's unit is one loop, not the mean
    of a loop and its healthy sibling.
    """

    unit: str
    loop: Loop
    seed: int
    record: LoopRecord
    sticky: bool
    size: Size
    representative: bool = True


def draw(grid: str | Path, groups: int, seed: int) -> list[Simulated]:
    """Simulate all loops of some groups of a grid."""
    source = load_grid(grid)
    rng = np.random.default_rng([seed, 1])
    order = rng.permutation(source.group_count)[:groups]
    out = []
    for index in Progress(order, desc="grid"):
        try:
            members = list(resolve(source.group(int(index))))
            pick = int(rng.integers(len(members)))
            for i, s in enumerate(members):
                run = simulate(s.loop, s.seed)
                record = run.record.without_mv()
                out.append(
                    Simulated(
                        str(index), s.loop, s.seed, record, run.sticky, Size.of(record), i == pick
                    )
                )
        except (UserError, SpecError):
            continue
    return out


def join(
    simulated: list[Simulated],
    effects: Mapping[str, list[dict[str, Any]]],
    loops: int,
    ruler: FeatureScaler,
    real_x: np.ndarray,
    base: np.ndarray,
    methods: list[str],
    rng: np.random.Generator,
) -> tuple[list[Contribution], dict[str, float]]:
    """Join effects to the grid one after the other, the one that closes most of the distance
    first.
    """
    # a diagnosis misses an effect in some loops that have it, and may not tell where it acts:
    # shares and places are tried
    left = {
        e: [v for w in _places(e, s) for v in _shares(e, w, loops, rng)]
        for e, s in effects.items()
        if len(s) >= _FEWEST_LOOPS
    }
    now, out = simulated, []
    before = accuracy(simulated, base, methods)
    nearest = mmd_squared(ruler, units(simulated), real_x)
    while left and len(out) < _MOST_EFFECTS and nearest > 0.0:
        standing = [s for s in now if s.representative]
        far = {
            v: mmd_squared(ruler, units(_with(standing, v)), real_x)
            for ways in left.values()
            for v in ways
        }
        best = min(far, key=lambda v: far[v])
        if far[best] >= nearest:
            break
        nearest = far[best]
        only = _with(simulated, best)
        reached = accuracy(only, verdicts_on(only, methods), methods)
        costs = {m: reached[m] - before[m] for m in methods}
        out.append(
            Contribution(best.effect, best.share, max(nearest, 0.0) ** 0.5, costs, best.strengths)
        )
        now = only if now is simulated else _with(now, best)
        del left[best.effect]
    return out, accuracy(now, verdicts_on(now, methods), methods) if out else before


@dataclass(frozen=True, eq=False)
class Way:
    """One way in which an effect may stand in a plant: in which share of its loops, with which
    strengths, drawn by a seed.
    """

    effect: str
    share: float
    strengths: tuple[dict[str, Any], ...]
    seed: int


def _places(effect: str, strengths: list[dict[str, Any]]) -> list[tuple[dict[str, Any], ...]]:
    """Return the strengths once for every place where the effect may act."""
    choice = EFFECTS[effect].parameters.get("at")
    if not isinstance(choice, Choice):
        return [tuple(strengths)]
    return [tuple(s | {"at": at} for s in strengths) for at in choice.names]


def _shares(
    effect: str, strengths: tuple[dict[str, Any], ...], loops: int, rng: np.random.Generator
) -> list[Way]:
    observed, seed = len(strengths) / loops, int(rng.integers(2**31))
    return [
        Way(effect, share, strengths, seed)
        for share in dict.fromkeys((observed, 0.5 * (1.0 + observed), 1.0))
    ]


def _with(simulated: list[Simulated], way: Way) -> list[Simulated]:
    """Return the grid's loops with an effect in a share of its units, of strengths measured on real
    loops.
    """
    rng = np.random.default_rng(way.seed)
    hit = {u: rng.random() < way.share for u in dict.fromkeys(s.unit for s in simulated)}
    drawn = {u: way.strengths[int(rng.integers(len(way.strengths)))] for u in hit}
    # friction is added to the representative loop of a unit alone: a healthy sibling stays healthy
    spared = way.effect in FRICTION_EFFECT
    return [
        _hit(s, way.effect, drawn[s.unit])
        if hit[s.unit] and (s.representative or not spared)
        else s
        for s in simulated
    ]


def _hit(s: Simulated, effect: str, strength: dict[str, Any]) -> Simulated:
    """Return a loop with an effect whose strength is relative to the size of the changed loop, as
    strengths are measured on loops that have the effect.
    """
    size, out = s.size, s
    before = (
        s.loop.model_copy(update={"valve": Part(name="ideal")})
        if effect in FRICTION_EFFECT
        else s.loop
    )
    try:
        for _ in range(_ROUNDS):
            loop = with_effect(before, effect, absolute(effect, strength, size))
            run = simulate(loop, s.seed)
            record = run.record.without_mv()
            size, out = (
                s.size.towards(Size.of(record)),
                replace(s, loop=loop, record=record, sticky=run.sticky),
            )
    except (UserError, SpecError):
        pass
    return out


def units(simulated: list[Simulated]) -> np.ndarray:
    """Return the features of the loops that stand for their groups, shape (groups, features)."""
    standing = [s for s in simulated if s.representative]
    return by_unit([looks(s.record) for s in standing], [s.unit for s in standing])[1]


def verdicts_on(simulated: list[Simulated], methods: list[str]) -> np.ndarray:
    """Return 1 for stiction, 0 for no stiction, NaN for no decision, shape (loops, methods)."""
    code = {STICTION: 1.0, "no_stiction": 0.0}
    return np.array(
        [[code.get(v.verdict, np.nan) for v in judge(s.record, methods)] for s in simulated]
    )


def accuracy(
    simulated: list[Simulated], verdicts: np.ndarray, methods: list[str]
) -> dict[str, float]:
    """Return the mean of the shares right of sticky and of healthy loops, by method; no decision is
    not right.
    """
    truth = np.array([float(s.sticky) for s in simulated])
    right = verdicts == truth[:, None]
    # a grid that is more sticky than healthy must not reward those who say so
    share = np.mean([right[truth == kind].mean(axis=0) for kind in np.unique(truth)], axis=0)
    return dict(zip(methods, share.tolist()))
