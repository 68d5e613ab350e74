"""Does a study find what a fleet hides? `python -m results.studies.plant.planted FOLDER` plants one
effect, and asks.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from results.studies.plant.answers import answered
from results.studies.plant.trust_claims import loops
from simbench.bench.statistics import wilson
from simbench.detectors.report.report import choose_methods
from simbench.files import folder, write_record
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulate
from simbench.plant.study.forward_selection import Simulated, accuracy, draw, units, verdicts_on
from simbench.plant.study.strengths import FRICTION_EFFECT, Size, absolute, with_effect
from simbench.plant.study.study import against, read_fleet
from simbench.plant.study.two_sample import FeatureScaler, classifier_test, mmd_test
from simbench.scenarios.spec import Loop, Part, Scenario
from simbench.usage import exit_code

GRID = "chapter"  # nothing archived, no friction but one valve's
COMES_AND_GOES = "intermittent sticking"
# strengths relative to the loop, drawn once for each fleet: spread of PV, range of OP, period
STRENGTHS: dict[str, dict[str, tuple[float, float]]] = {
    "quantisation": {"step": (0.4, 1.0)},
    "compression": {"band": (0.1, 0.4)},
    "oscillation": {"amplitude": (0.3, 0.8), "period": (0.5, 2.0)},
    COMES_AND_GOES: {"S": (0.5, 1.5), "slip": (0.2, 1.0), "period": (8.0, 16.0)},
}
# by which of a diagnosis's names an effect is called right, where that is not its name
CALLED = {COMES_AND_GOES: FRICTION_EFFECT}
WIDEST = 25.0  # % of travel
POOL = 400  # loops from which healthy fleets and grids are drawn
LEVEL = 0.05
MORE = 4  # times the loops of a fleet or grid that are drawn, where only the sound ones are wanted


def plant(loop: Loop, effect: str, strength: dict[str, float], size: Size) -> Loop:
    """Return a loop with what its fleet hides; sticking that comes and goes is that of its valve.

    Parameters
    ----------
    loop : Loop
    effect : str
        One of `STRENGTHS`.
    strength : dict
        Relative to the loop.
    size : Size
        Of the loop's record.

    Returns
    -------
    Loop
    """
    if effect != COMES_AND_GOES:
        more: dict[str, Any] = {"at": "record"} if effect == "quantisation" else {}
        return with_effect(loop, effect, absolute(effect, strength | more, size))
    S, period = min(strength["S"] * size.op, WIDEST), strength["period"] * size.period
    spells = {"S": S, "J": strength["slip"] * S, "period": period, "on": 0.5 * period}
    return loop.model_copy(update={"valve": Part(name="intermittent", parameters=spells)})


def asked(effect: str, seed: int, records: int, groups: int) -> dict[str, Any]:
    """Return the study of one fleet, and the truth.

    Parameters
    ----------
    effect : str
    seed : int
    records, groups : int
        Of the fleet, of the grid.

    Returns
    -------
    dict
        planted; p (distance); order of the named effects; predicted and true change of every
        method's accuracy on the grid's loops, 0 predicted where the effect was not named.

    Notes
    -----
    In half the loops of the grid the valve sticks: of sticking that comes and goes, fleet and grid
    are drawn from the others.
    """
    rng, methods = (
        np.random.default_rng([seed, list(STRENGTHS).index(effect)]),
        choose_methods(["fast"]),
    )
    strength = {k: float(rng.uniform(*ends)) for k, ends in STRENGTHS[effect].items()}
    with tempfile.TemporaryDirectory() as place:
        for i, s in enumerate(_fleet(records, seed, sound=effect == COMES_AND_GOES)):
            size = Size.of(simulate(s.loop, s.seed).record.without_mv())
            loop = plant(s.loop, effect, strength, size)
            write_record(simulate(loop, s.seed).record.without_mv(), Path(place) / f"L{i}.csv")
        simulated = sound(groups, seed) if effect == COMES_AND_GOES else draw(GRID, groups, seed)
        result = against(read_fleet(place), simulated, GRID, methods, seed=seed)
    # friction is what is asked for: a sibling stays sound
    now = [
        _with(s, effect, strength) if s.representative or effect != COMES_AND_GOES else s
        for s in simulated
    ]
    before, after = (accuracy(x, verdicts_on(x, methods), methods) for x in (simulated, now))
    first = next((e for e in result.effects if e.effect in CALLED.get(effect, (effect,))), None)
    return {
        "planted": effect,
        "p": result.distance["p"],
        "order": [e.effect for e in result.effects],
        "predicted": {m: first.costs[m] if first else 0.0 for m in methods},
        "true": {m: after[m] - before[m] for m in methods},
    }


def _fleet(records: int, seed: int, sound: bool) -> list[Scenario]:
    """Return loops of the grid, one of each group; only loops whose valve is sound where those are
    asked for.
    """
    if not sound:
        return list(loops(records, 2 * (seed + 1), GRID))
    some = loops(MORE * records, 2 * (seed + 1), GRID)
    return list(islice((s for s in some if not plain_setup(s.loop, 0).sticky), records))


def sound(groups: int, seed: int) -> list[Simulated]:
    """Return loops of the grid whose valve is sound, each twice: one that friction may be put into,
    and its sibling.

    Parameters
    ----------
    groups, seed : int
        As `draw` takes them.

    Returns
    -------
    list of Simulated
    """
    out = []
    for s in islice((s for s in draw(GRID, MORE * groups, seed) if not s.sticky), groups):
        out += [replace(s, representative=True), replace(s, representative=False)]
    return out


def _with(s: Simulated, effect: str, strength: dict[str, float]) -> Simulated:
    loop = plant(s.loop, effect, strength, s.size)
    sticky = s.sticky or effect == COMES_AND_GOES
    return replace(s, loop=loop, record=simulate(loop, s.seed).record.without_mv(), sticky=sticky)


def summary_lines(rows: list[dict[str, Any]]) -> list[str]:
    """Return how often the planted effect ranks first, and how well its cost was predicted.

    Parameters
    ----------
    rows : list of dict
        As `asked` gives them.

    Returns
    -------
    list of str
    """
    from scipy.stats import spearmanr

    lines = [
        f"{'planted':<22} {'first':>16}  {'found':>5}  {'told apart':>10}  {'off by (points)':>15} "
        f" {'rank corr.':>10}"
    ]
    for effect in [*dict.fromkeys(r["planted"] for r in rows), "all"]:
        here = [r for r in rows if effect in (r["planted"], "all")]
        first = sum(_right(r, r["order"][:1]) for r in here)
        named = sum(_right(r, r["order"]) for r in here)
        apart = sum(r["p"] <= LEVEL for r in here)
        pairs = np.array([(r["predicted"][m], r["true"][m]) for r in here for m in r["true"]])
        off = 100 * np.abs(pairs[:, 0] - pairs[:, 1]).mean()
        moved = np.ptp(pairs, axis=0).min() > 0
        rank = f"{spearmanr(*pairs.T).statistic:.2f}" if moved else "none"
        lo, hi = wilson(first, len(here))
        lines.append(
            f"{effect:<22} {first:>3}/{len(here)} ({lo:.2f}-{hi:.2f})  {named:>5}  {apart:>10} "
            f" {off:>15.1f}  {rank:>10}"
        )
    return lines


def _right(row: dict[str, Any], named: list[str]) -> bool:
    """Return whether what was planted is among the effects named."""
    return any(e in named for e in CALLED.get(row["planted"], (row["planted"],)))


def healthy(runs: int, records: int, groups: int) -> list[str]:
    """Return how often a fleet without effect differs from its grid, both drawn from one pool.

    The two have no loop in common.
    """
    x, rng = units(draw(GRID, POOL, 0)), np.random.default_rng(0)
    small = np.zeros(2, dtype=int)
    for _ in tqdm(range(runs), file=sys.stderr, desc="fleets without effect"):
        pick = rng.permutation(len(x))
        real, sim = x[pick[:records]], x[pick[records : records + groups]]
        ruler = FeatureScaler.of(sim, real)
        p = (
            mmd_test(ruler, sim, real, rng)["p"],
            classifier_test(ruler.measured(sim), ruler.measured(real), rng)[1],
        )
        small += np.array(p) <= LEVEL
    shares = []
    for name, k in zip(("kernel distance", "classifier"), small):
        lo, hi = wilson(k, runs)
        shares.append(f"{k / runs:.3f} ({lo:.3f} to {hi:.3f}) by {name}")
    return [
        "",
        (
            f"{runs} fleets of {records} without effect, grids of {groups}: told apart at p <="
            f" {LEVEL}: {', '.join(shares)}"
        ),
    ]


def main(arguments: list[str] | None = None) -> int:
    """Plant each effect in fleets of several seeds, ask a study of each, and print its answers;
    goes on where it stopped.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.planted", description=__doc__
    )
    parser.add_argument("out", type=Path, metavar="FOLDER", help="Where the answers are kept.")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--records", type=int, default=30, help="Loops of a fleet [30].")
    parser.add_argument("--groups", type=int, default=40, help="Of the grid [40].")
    parser.add_argument(
        "--healthy",
        type=int,
        default=200,
        help="Fleets without effect, by permutation alone [200].",
    )
    given = parser.parse_args(arguments)
    folder(given.out)
    rows = []
    for seed in range(given.seeds):
        for effect in STRENGTHS:
            file = (
                given.out / f"{effect.replace(' ', '-')}-{seed}-{given.records}-{given.groups}.json"
            )
            rows.append(answered(file, partial(asked, effect, seed, given.records, given.groups)))
    head = (
        f"{given.seeds} seeds, fleets of {given.records} loops against {given.groups} groups of"
        f" grid {GRID}"
    )
    results = [head, *summary_lines(rows)] if rows else []
    print(
        "\n".join(
            results + (healthy(given.healthy, given.records, given.groups) if given.healthy else [])
        )
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
