"""One labelled case: a record of a random loop with none, one or two effects, or a foreign kind, of the strength asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from detectors.errors import ParameterError, UnknownName
from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.closed_loop.summary_features import as_matrix, distance, floor_of, seed_spread
from simbench.gap.decide.training.bench import Bench, draw_bench, look
from simbench.gap.decide.training.foreign import FOREIGN, run_foreign
from simbench.gap.decide.training.sizes import Scales, friction, scales
from simbench.gap.effects import recogniser
from simbench.gap.effects._draw import Size
from simbench.loop.effects import EFFECTS, PLUGINS
from simbench.loop.parameters import resolve
from simbench.loop.setup import Setup

# The gap that the loop without the effect leaves, over the floor of chance alone: the classes of the blind check's rules.
STRENGTHS = {"weak": (1.3, 2.0), "medium": (2.0, 4.0), "strong": (4.0, 12.0)}
SHARES = {"weak": 0.2, "medium": 0.4, "strong": 0.4}
RUNS = 8  # of the loop without effect, that give the floor
TRIES = 12  # sizes of one effect in one loop before another loop is drawn
PATIENCE = 15  # loops for which direction and strength stay as drawn
LOOPS = 200  # loops before giving up
STOPPED = 0.01  # largest share of samples that OP of a healthy loop may spend at 0 or 100 %
MOVES = 10  # fewest samples of a record at which PV changes, and OP
RUNAWAY = 0.1  # the same with an effect: beyond, the record shows a tripped loop
FAMILY = 20_731  # root of all seeds here, so that no other study draws the same loops

Measured = tuple[float, LoopRecord, dict[str, Any]]


@dataclass(frozen=True, eq=False)
class TrainingCase:
    """A record, the baseline a diagnosis is given, and the truth.

    `block` is that of the foreign kind ("" without); `strength` is none, weak, medium or strong, of two effects the weaker
    one's alone; `ratio` is gap over floor of the whole record; `parameters` maps effect or foreign kind to its numbers;
    `bench` is the loop without them, and `loops` counts the loops drawn until one fitted.
    """

    record: LoopRecord
    baseline: Loop
    effects: tuple[str, ...]
    foreign: str
    block: str
    strength: str
    ratio: float
    parameters: dict[str, dict[str, Any]]
    bench: Bench
    seed: int
    loops: int


@dataclass(frozen=True, eq=False)
class Faultless:
    """What chance alone makes of a loop: features of faultless runs, their spread and their distance from each other."""

    features: np.ndarray
    spread: np.ndarray
    floor: float

    def ratio(self, record: LoopRecord) -> float:
        """Return the record's distance from the faultless runs over the floor."""
        real = np.array(list(look(record).values()))
        return distance(real, self.features, self.spread) / self.floor


def draw_case(
    seed: int, effects: Sequence[str] = (), foreign: str = "", mv: bool | None = None, strength: str = ""
) -> TrainingCase:
    """Draw one case; the same arguments give the same bits.

    Parameters
    ----------
    seed : int
        Root of everything random.
    effects : sequence of str
        None, one or two effect ids.
    foreign : str
        A kind of `FOREIGN` instead of effects.
    mv : bool, optional
        Whether MV is recorded; drawn when absent.
    strength : {"", "weak", "medium", "strong"}
        Class of gap over floor; drawn when empty, for two effects from medium and strong, each effect alone.

    Returns
    -------
    TrainingCase

    Raises
    ------
    UnknownName, ParameterError
        For names that do not exist, effects and a foreign kind together, or friction twice.

    Notes
    -----
    Known load means: the same loop with the same load and noise statistics, other seeds. A healthy valve has play in 12 % of
    the loops, but not where stiction, which takes its place, or a foreign kind is drawn.
    Not for judging a diagnosis: it is what the diagnosis was trained on.

    Examples
    --------
    >>> case = draw_case(1, ("op_quantisation",), strength="medium")
    >>> case.effects, 2.0 <= case.ratio <= 4.0
    (('op_quantisation',), True)
    """
    effects = tuple(effects)
    _check(effects, foreign, strength)
    rng = np.random.default_rng([FAMILY, seed])
    chance = bool(rng.random() < 0.5)  # drawn in any case: with and without MV it is the same loop
    recorded = chance if mv is None else mv
    kind = FOREIGN.get(foreign)
    what = crc32(" ".join((*effects, foreign)).encode())
    for loops in range(1, LOOPS + 1):
        bench = draw_bench(
            rng,
            foptd=any(recogniser(e).replaces == "T" for e in effects) or (kind is not None and kind.foptd),
            steps=kind is not None and kind.steps,
            play=kind is None and not any(_slips(e) for e in effects),
        )
        streams = (FAMILY, seed, loops)
        # what was drawn of strength and direction waits some loops for one it fits: easy ones must not crowd out the others
        luck = np.random.default_rng([FAMILY, seed, what, loops // PATIENCE])
        cloud = _cloud(bench, streams)
        if cloud is None:
            continue
        if foreign:
            found = _foreign(bench, streams, foreign, cloud, strength, luck)
        elif effects:
            found = _known(bench, streams, effects, cloud, strength, luck)
        else:
            record = bench.run(bench.finish(bench.setup(streams), streams))
            found = ("none", (cloud.ratio(record), record, {})) if _stopped(record) <= STOPPED else None
        if found is None:
            continue
        grade, (ratio, record, parameters) = found
        return TrainingCase(
            record=_with_mv(record, recorded, rng),
            baseline=bench.baseline(rng),
            effects=effects,
            foreign=foreign,
            block=kind.block if kind else "",
            strength=grade,
            ratio=ratio,
            parameters=parameters,
            bench=bench,
            seed=seed,
            loops=loops,
        )
    raise ParameterError(f"training: no loop of {LOOPS} shows {foreign or ' and '.join(effects)} as {strength or 'anything'}")


def _check(effects: tuple[str, ...], foreign: str, strength: str) -> None:
    for effect in effects:
        if effect not in EFFECTS:
            raise UnknownName("effect", effect, EFFECTS)
    if foreign and foreign not in FOREIGN:
        raise UnknownName("foreign kind", foreign, FOREIGN)
    if strength and strength not in STRENGTHS:
        raise UnknownName("strength", strength, STRENGTHS)
    if strength and not effects and not foreign:
        raise ParameterError(f"training: strength {strength!r} of no effect; name one, or leave the strength empty")
    if foreign and effects:
        raise ParameterError(f"training: foreign kind {foreign!r} and effects together; one or the other")
    if len(set(effects)) < len(effects) or len(effects) > 2:
        raise ParameterError(f"training: effects {effects}; at most two different ones are drawn together")
    if sum(recogniser(e).band is not None for e in effects) > 1:
        raise ParameterError(f"training: {' and '.join(effects)} together; a valve has one friction")


def _cloud(bench: Bench, streams: tuple[int, ...]) -> Faultless | None:
    runs = []
    for i in range(RUNS):
        seeds = (*streams, 1000 + i)
        record = bench.run(bench.finish(bench.setup(seeds), seeds))
        if not _stopped(record) <= STOPPED:
            return None
        runs.append(look(record))
    features = as_matrix(runs)
    spread = seed_spread(features)
    return Faultless(features, spread, floor_of(features, spread))


def _known(bench: Bench, streams: tuple, effects: tuple[str, ...], cloud: Faultless, strength: str, luck: np.random.Generator):
    own = scales(bench, bench.run(bench.finish(bench.setup(streams), streams)))
    grades = [strength or _grade(luck, at_least_medium=len(effects) > 1) for _ in effects]
    sizes, x = [_size(e, own, luck) for e in effects], []
    last: Measured | None = None
    for effect, size, grade in zip(effects, sizes, grades):
        hit = _search(lambda x, e=effect, s=size: _measure(bench, streams, (e,), (s,), (x,), cloud), own, grade, cloud, luck)
        if hit is None:
            return None
        x.append(hit[0])
        last = hit[1]
    if len(effects) > 1:
        last = _measure(bench, streams, effects, sizes, x, cloud)
    return None if last is None else (min(grades, key=list(STRENGTHS).index), last)


def _foreign(bench: Bench, streams: tuple, kind: str, cloud: Faultless, strength: str, luck: np.random.Generator):
    own = scales(bench, bench.run(bench.finish(bench.setup(streams), streams)))

    def measure(x: float) -> Measured | None:
        setup = bench.finish(bench.setup(streams), streams)
        record, numbers = run_foreign(kind, setup, own, x, np.random.default_rng([*streams, 3]))
        return _judged(record, cloud, {kind: numbers})

    grade = strength or _grade(luck)
    hit = _search(measure, own, grade, cloud, luck)
    return None if hit is None else (grade, hit[1])


def _search(
    measure: Callable[[float], Measured | None], scales: Scales, grade: str, cloud: Faultless, rng: np.random.Generator
) -> tuple[float, Measured] | None:
    low, high = STRENGTHS[grade]
    if cloud.ratio(scales.record) >= 0.92 * low:
        return None  # chance alone would pass for the effect
    a, b = 0.0, 1.0
    for _ in range(TRIES):
        # halved at random, so that sizes do not gather at the marks of a grid; a loop that shows too little is given up soon
        x = a + (b - a) * float(rng.uniform(0.3, 0.7) if a == 0.0 or b < 1.0 else rng.uniform(0.6, 1.0))
        found = measure(x)
        if found is None or found[0] > high:
            b = x
        elif found[0] >= low:
            return x, found
        else:
            a = x
        if b - a < 0.002 or a > 0.95:
            return None
    return None


def _slips(effect: str) -> bool:
    """Return whether an effect is friction with a jump, which real valves have by laws of their own."""
    return {"S", "J"} <= set(EFFECTS[effect].parameters)


def _size(effect: str, own: Scales, luck: np.random.Generator) -> Size:
    model = {"model": friction(luck)} if _slips(effect) else {}
    draw = recogniser(effect).draw
    if draw is None:
        raise ParameterError(f"training: nobody said how to draw {effect!r} at random")
    size = draw(own, luck)
    return lambda x: size(x) | model


def _measure(
    bench: Bench, streams: tuple, effects: Sequence[str], sizes: Sequence[Size], x: Sequence[float], cloud: Faultless
) -> Measured | None:
    setup = bench.setup(streams)
    tables = {effect: size(at) for effect, size, at in zip(effects, sizes, x)}
    for i, (effect, table) in enumerate(tables.items()):
        _apply(setup, effect, table, np.random.default_rng([*streams, 3 + i]))
    record = bench.run(bench.finish(setup, streams))
    return _judged(record, cloud, tables)


def _apply(setup: Setup, effect: str, table: dict[str, Any], rng: np.random.Generator) -> None:
    if "model" in table:
        setup.add_valve(table["model"], {"S": table["S"], "J": table["J"]}, first=True)
        return
    plugin = PLUGINS.load(effect)
    plugin.apply(setup, resolve(plugin.PARAMETERS, table, f"effect {effect!r}"), rng)


def _judged(record: LoopRecord, cloud: Faultless, parameters: dict[str, dict[str, Any]]) -> Measured | None:
    # None: the loop has tripped or stands still, which is too much of the effect
    return (cloud.ratio(record), record, parameters) if _stopped(record) <= RUNAWAY and _alive(record) else None


def _alive(record: LoopRecord) -> bool:
    # PV and OP change, and the valve turns round: a record of a seized valve tells nothing
    assert record.mv is not None
    move = np.diff(record.mv)
    turns = np.count_nonzero(np.diff(np.sign(move[np.abs(move) > 1e-6])))
    return bool(turns >= 2) and all(np.count_nonzero(np.diff(x)) >= MOVES for x in (record.pv, record.op))


def _stopped(record: LoopRecord) -> float:
    return float(np.mean((record.op <= 0.0) | (record.op >= 100.0)))


def _grade(rng: np.random.Generator, at_least_medium: bool = False) -> str:
    open_to = [s for s in STRENGTHS if not (at_least_medium and s == "weak")]
    p = np.array([SHARES[s] for s in open_to])
    return str(rng.choice(open_to, p=p / p.sum()))


def _with_mv(record: LoopRecord, recorded: bool, rng: np.random.Generator) -> LoopRecord:
    if not recorded:
        return replace(record, mv=None)
    assert record.mv is not None
    noise = float(rng.uniform(0.0, 0.05)) * rng.standard_normal(record.n)
    return replace(record, mv=np.round(record.mv + noise, 4))
