"""Searches the size of an effect on one loop until the oracle's ratio lies in its band."""

from __future__ import annotations

import math

import numpy as np

from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds.refinery import foreign, oracle
from results.studies.worlds.refinery.effects import APPLY, complete
from results.studies.worlds.refinery.simulation import Setup, build, run
from results.studies.worlds.refinery.sizes import FOREIGN_SIZES, SIZES, Size
from simbench.detectors.errors import UnknownName

CLOUD, SHOWN = (
    12,
    6,
)  # realisations without and with the effect that make a ratio; the first shown is the record's own
_STEPS = 10  # sizes tried on one loop
_TWO = (2.0, 8.0)  # ratio of each of two effects alone
_STILL_VISIBLE = 1.3  # ratio of each against the loop that has the other already


class Misfit(Exception):
    """This loop cannot hold this effect at this strength."""


def prepared(case: dict, wanted: list[dict], nominal: bool = False) -> Setup:
    """Return the numbers of the loop of `case` with effects (ids of the vocabulary or foreign
    kinds) put in.
    """
    setup = build(case, nominal)
    for item in wanted:
        name, parameters = item["effect"], dict(item.get("parameters", {}))
        if name in WORLD_EFFECTS:
            APPLY[name](setup, complete(name, parameters, case), case)
        elif name in foreign.EVERY:
            foreign.APPLY[name](setup, foreign.check(name, parameters), case)
        else:
            raise UnknownName("effect", str(name), [*WORLD_EFFECTS, *foreign.EVERY])
    return setup


def healthy(record: dict[str, np.ndarray], case: dict, effects: list[dict]) -> bool:
    """Whether the loop works: OP off its limits (unless they are the effect), PV near SP, both
    alive, the valve moving.
    """
    op, e = record["op"], record["sp"] - record["pv"]
    if not (np.all(np.isfinite(op)) and np.all(np.isfinite(e))):
        return False
    limited = any(item["effect"] == "saturation" for item in effects)
    if not limited and float(np.mean((op <= 0.05) | (op >= 99.95))) > 0.01:
        return False
    moved = float(np.mean(np.abs(np.diff(record["mv"])) > 1e-3))
    return bool(
        np.std(op) > 0.05
        and np.ptp(record["mv"]) > 0.1
        and moved > 0.003
        and float(np.quantile(np.abs(e), 0.99)) < 0.35 * case["span"]
        and np.unique(op).size > 4
    )


class Bench:
    """One loop with its cloud: measures the ratio of effects on it."""

    def __init__(self, case: dict, base: list[dict], seeds: np.ndarray) -> None:
        self._case, self._base = case, base
        self._seeds, self._time = seeds, case["time"] / case["Ts"]
        self.first: dict[str, np.ndarray] = {}
        self._cloud = oracle.Cloud(self._measure([], seeds[:CLOUD]))

    def _measure(self, extra: list[dict], seeds: np.ndarray) -> list[list[np.ndarray]]:
        effects, many = [*self._base, *extra], []
        setup = prepared(self._case, effects)
        for seed in seeds:
            record = run(setup, self._case, int(seed))
            if not healthy(record, self._case, effects):
                raise Misfit
            self.first = self.first or record
            many.append(oracle.features(record, self._time))
        return many

    def ratio(self, extra: list[dict]) -> float:
        """Return the ratio of `extra`; infinity where a loop with it no longer works."""
        try:
            return self._cloud.ratio(self._measure(extra, self._seeds[CLOUD:]))
        except Misfit:
            return math.inf


def sized(
    bench: Bench,
    name: str,
    size: Size,
    shape: dict,
    case: dict,
    band: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[dict, float]:
    """Search the size at which the ratio falls into `band`; return the effect's table and the
    ratio.

    The first size is random; then the bracket is halved, in the logarithm, towards the band.
    """
    low, high = math.log(size.low), math.log(size.high)
    at = rng.uniform(low, low + 0.6 * (high - low))
    for _ in range(_STEPS):
        item = {"effect": name, "parameters": size.parameters(math.exp(at), shape, case)}
        ratio = bench.ratio([item])
        if band[0] <= ratio <= band[1]:
            return item, ratio
        if ratio < band[0]:
            low = at
        else:
            high = at
        if high - low < 0.01:
            break
        at = 0.5 * (low + high)
    raise Misfit


def one(
    name: str, band: tuple[float, float], case: dict, seeds: np.ndarray, rng: np.random.Generator
) -> tuple[list[dict], float]:
    """Return one effect whose ratio on this loop lies in `band`, and the ratio; Misfit where there
    is none.
    """
    bench = Bench(case, [], seeds)
    size = SIZES[name] if name in SIZES else FOREIGN_SIZES[name]
    shape = size.shape(rng, case, bench.first)
    item, ratio = sized(bench, name, size, shape, case, band, rng)
    return [item], ratio


def two(
    names: tuple[str, str], case: dict, seeds: np.ndarray, rng: np.random.Generator
) -> tuple[list[dict], float]:
    """Return two effects, each visible alone and with the other, and the smaller ratio; Misfit
    where there are none.
    """
    bench = Bench(case, [], seeds)
    effects = []
    for name in names:
        shape = SIZES[name].shape(rng, case, bench.first)
        effects.append(sized(bench, name, SIZES[name], shape, case, _TWO, rng))
    (first, r1), (second, r2) = effects
    for base, extra in ((first, second), (second, first)):
        if not _STILL_VISIBLE <= Bench(case, [base], seeds).ratio([extra]) < math.inf:
            raise Misfit
    return [first, second], min(r1, r2)
