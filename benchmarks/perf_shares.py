"""Where a scenario's CPU time goes: loop kernel, its set-up, truth, theory, front end, each
detector, the oracle, store and glue.

Shares are compared with the committed ones, which `--update` writes.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import simbench.bench.execute.compute_piece as piece_module
import simbench.loop.kernel
from simbench.bench.execute import pieces
from simbench.bench.scenario import truth
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.store import tables
from simbench.bench.store.manifest import MANIFEST
from simbench.detectors import prepared
from simbench.detectors.plugins.registry import methods
from simbench.detectors.report.report import choose_methods
from simbench.scenarios.expansion import Grid
from simbench.scenarios.settled import SettledGrid, settled_grid

GRID = "chapter"
BLOCKS, BLOCK = (
    3,
    20,
)  # so many blocks of neighbouring groups, which share what a real run's neighbours share
ROUNDS = 3
COMMITTED = Path(__file__).parents[1] / "results" / "perf_shares.json"
# a share may double and grow by three hundredths: kernels that fill the vector registers take twice
# as long, and the rest hardly longer, where another guest of the host keeps the core's second
# thread busy (hammerstein: 14 % and 27 % of one code)
GROWTH, SLACK = 2.0, 0.03
RATIO = 1.5  # growth of what full costs in fasts


class Meter:
    """CPU time by name: whoever runs is charged, and what it calls under another name is not."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._running, self._since = ["glue"], time.process_time()

    def wrap(self, name: str, function: Callable) -> Callable:
        """Return the function, its time charged to `name`."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            self.charge()
            self._running.append(name)
            try:
                return function(*args, **kwargs)
            finally:
                self.charge()
                self._running.pop()

        return timed

    def charge(self) -> None:
        now = time.process_time()
        self.seconds[self._running[-1]] = (
            self.seconds.get(self._running[-1], 0.0) + now - self._since
        )
        self._since = now


def metered(meter: Meter, names: list[str]) -> list[tuple[Any, str, Any]]:
    """Put the meter into everything that has a line in the table; return what must be put back."""
    alone = "simulate, without its kernel"
    simulate = meter.wrap(alone, truth.simulate)
    compiled = simbench.loop.kernel.compiled
    places = [
        (simbench.loop.kernel, "compiled", lambda *a: meter.wrap("loop kernel", compiled(*a))),
        (truth, "simulate", simulate),
        (piece_module, "settled", meter.wrap("loops of the table", piece_module.settled)),
        (SettledGrid, "group", meter.wrap("loops of the table", SettledGrid.group)),
        (
            piece_module,
            "simulate_with_truth",
            meter.wrap("truth labels", piece_module.simulate_with_truth),
        ),
        (piece_module, "_predict_cycle", meter.wrap("theory columns", piece_module._predict_cycle)),
        (
            prepared,
            "find_oscillation",
            meter.wrap("front end", prepared.find_oscillation),
        ),
        (prepared, "inspect", meter.wrap("quality flags", prepared.inspect)),
        (piece_module, "judge_oracle", meter.wrap(ORACLE, piece_module.judge_oracle)),
        (piece_module, "scenario_row", meter.wrap("rows", piece_module.scenario_row)),
        (piece_module, "verdict_row", meter.wrap("rows", piece_module.verdict_row)),
        (tables, "encode", meter.wrap("store", tables.encode)),
        (pieces, "write_piece", meter.wrap("store", pieces.write_piece)),
    ]
    for name in names:
        module = methods.load(name)
        places.append((module, "detect", meter.wrap(name, module.detect)))
    before = [(owner, attribute, getattr(owner, attribute)) for owner, attribute, _ in places]
    for owner, attribute, timed in places:
        setattr(owner, attribute, timed)
    return before


def shares(plan: Grid, names: list[str], blocks: list[range]) -> tuple[dict[str, float], int]:
    """Run some blocks of a grid as a worker does; return milliseconds of CPU per scenario by name,
    and the scenarios.
    """
    meter, count = Meter(), 0
    before = metered(meter, names)
    try:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, MANIFEST).touch()  # without which a folder is no run's
            start = time.process_time()
            for number, groups in enumerate(blocks):
                piece = piece_module.compute_piece(
                    plan, number, groups, piece_module.PieceSettings((*names, ORACLE))
                )
                pieces.write_piece(Path(folder), piece, "")
                count += piece.receipt.scenarios
            meter.charge()
            total = time.process_time() - start
    finally:
        for owner, attribute, function in before:
            setattr(owner, attribute, function)
    assert abs(sum(meter.seconds.values()) - total) < 0.02 * total, (
        "the parts do not add up to the whole"
    )
    return {k: 1e3 * v / count for k, v in meter.seconds.items()}, count


def measured() -> dict[str, Any]:
    """Measure both budgets in turn, always on other blocks so that nothing is remembered from the
    one before.
    """
    plan = settled_grid(GRID)
    starts = range(0, plan.group_count - plan.group_count // BLOCKS + 1, plan.group_count // BLOCKS)
    budgets = {budget: choose_methods([budget]) for budget in ("fast", "full")}
    # what compiles, compiles before the clock runs
    piece_module.compute_piece(
        plan,
        0,
        [g for s in starts for g in range(s, s + BLOCK, 2)],
        piece_module.PieceSettings((*budgets["full"], ORACLE)),
    )
    rounds: dict[str, list] = {budget: [] for budget in budgets}
    for r in range(1, ROUNDS + 1):
        for i, (budget, names) in enumerate(budgets.items()):
            first = (len(budgets) * r + i) * BLOCK
            rounds[budget].append(
                shares(plan, names, [range(s + first, s + first + BLOCK) for s in starts])
            )
    return {budget: summary(measures) for budget, measures in rounds.items()}


def summary(rounds: list[tuple[dict[str, float], int]]) -> dict[str, Any]:
    """Return the cheapest round with its shares, which add up, and the median over the rounds."""
    totals = [sum(measures.values()) for measures, _ in rounds]
    best = rounds[int(np.argmin(totals))][0]
    ordered = sorted(best, key=lambda name: -best[name])
    return {
        "scenarios": sum(count for _, count in rounds),
        "minimum_ms": round(min(totals), 3),
        "median_ms": round(float(np.median(totals)), 3),
        "ms": {name: round(best[name], 4) for name in ordered},
        "share": {name: round(best[name] / min(totals), 4) for name in ordered},
    }


def grown(now: dict[str, Any], committed: dict[str, Any]) -> list[str]:
    """Return a sentence for each share, and for the ratio of the budgets, that outgrew the
    committed one; never for times.
    """
    faults = []
    for budget, was in committed.items():
        for name, share in now[budget]["share"].items():
            before = was["share"].get(name, 0.0)
            if share > GROWTH * before + SLACK:
                faults.append(
                    f"{budget}: {name} takes {share:.1%} of a scenario, {before:.1%} when last"
                    " committed"
                )
    ratios = [t["full"]["minimum_ms"] / t["fast"]["minimum_ms"] for t in (now, committed)]
    if ratios[0] > RATIO * ratios[1]:
        faults.append(
            f"full costs {ratios[0]:.1f} times fast, {ratios[1]:.1f} times when last committed"
        )
    return faults


def main() -> int:
    measures = measured()
    for budget, table in measures.items():
        print(
            f"{budget}: CPU per scenario of {GRID}: minimum {table['minimum_ms']:.2f} ms, median"
            f" {table['median_ms']:.2f} ms"
        )
        for name, value in table["ms"].items():
            print(f"  {name:<30} {value:8.3f} ms {table['share'][name]:7.1%}")
        print(
            f"  {'sum':<30} {sum(table['ms'].values()):8.3f} ms {sum(table['share'].values()):7.1%}"
        )
    if "--update" in sys.argv:
        COMMITTED.write_text(json.dumps(measures, indent=1) + "\n")
        return 0
    wrong = grown(measures, json.loads(COMMITTED.read_text()))
    print(*(wrong or [f"no share outgrew {COMMITTED.name}"]), sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
