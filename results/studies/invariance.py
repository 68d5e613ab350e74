"""Invariance: dense loops judged again in another unit, sign, time or sampling; how often a verdict changes."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

from detectors.contract.detector import THINNED, backwards, turned
from detectors.judge import judge
from detectors.plugins.registry import methods as registry
from detectors.prepared import DENSEST, prepare, thinned
from detectors.record import LoopRecord
from detectors.report.report import table
from detectors.verdict import NO_DECISION
from scenarios.grid import load_grid
from scenarios.spec import Scenario
from simbench.bench.scenario.resolve import resolve
from simbench.loop.simulate import simulate
from simbench.usage import exit_code

MOST = 64  # times as dense as in the grid
BACKWARDS = "read backwards"
SEED = 20131


def _scaled(record: LoopRecord) -> LoopRecord:
    a, b = 40.0, -300.0
    return replace(record, pv=0.02 * record.pv, op=a * record.op + b, op_span=(b, 100.0 * a + b), pv_span=None,
                   sp=None if record.sp is None else 0.02 * record.sp)  # fmt: skip


def _shifted(record: LoopRecord) -> LoopRecord:
    return replace(record, pv=record.pv + 2000.0, sp=None if record.sp is None else record.sp + 2000.0, pv_span=None)


TRANSFORMATIONS: dict[str, Callable[[LoopRecord], LoopRecord]] = {
    "unit of OP and PV": _scaled,
    "offset of PV": _shifted,
    "sign of both": turned,
    "unit of time": lambda r: replace(r, Ts=r.Ts / 3600.0),
    **{f"every {k} samples one": lambda r, k=k: thinned(r, k) for k in THINNED},
    BACKWARDS: backwards,
}


def dense_records(grids: dict[str, int]) -> Iterator[LoopRecord]:
    """Yield so many loops of each grid, spread over its groups; one sample of eight still gives 125 a period."""
    for grid, wanted in grids.items():
        content = load_grid(grid, {"seed": SEED, "repeats": 1})
        step, given = max(content.group_count // wanted, 1), 0
        for index in range(0, content.group_count, step):
            group = resolve(content.group(index))
            scenario = group[index // step % len(group)]
            if given < wanted:
                given += 1
                yield _dense(scenario)


def _dense(scenario: Scenario) -> LoopRecord:
    at, times = scenario.loop.sampling, max(THINNED)
    while True:
        loop = scenario.loop.with_("sampling.Ts", at.Ts / times).with_("sampling.n", at.n * times)
        record = simulate(loop, scenario.seed).record
        period = prepare(record.without_mv()).oscillation.period_s / loop.sampling.Ts
        if times >= MOST or not period < max(THINNED) * DENSEST / 2:
            return replace(record, op_span=record.op_span or (0.0, 100.0))
        times *= 2


def _said(record: LoopRecord, seen: LoopRecord, blind: list[str], mv: list[str], **how: bool) -> list[str]:
    """Return the verdicts of methods that see OP and PV, then of those that see MV."""
    return [v.verdict for v in (*judge(record.without_mv(), blind, **how), *judge(seen, mv, **how))]


def rows(grids: dict[str, int]) -> list[dict[str, object]]:
    """Return per transformation, and per method, how often verdicts change."""
    names = registry.names()
    blind, mv = (
        [n for n in names if not registry.load(n).METHOD.needs_mv],
        [n for n in names if registry.load(n).METHOD.needs_mv],
    )
    asked: Counter[tuple[str, str]] = Counter()
    found: Counter[tuple[str, str]] = Counter()
    for record in dense_records(grids):
        plain = _said(record, record, blind, mv)
        # what sets in is an oscillation and what dies out is none: the front end tells forwards from backwards, methods do not
        whole = _said(record, record, blind, mv, raw=True, halves=False)
        for what, change in TRANSFORMATIONS.items():
            # MV is in % whatever the unit of OP: the methods that see it keep OP's unit
            other = change(record)
            seen = record if what == "unit of OP and PV" else other
            how = {"raw": True, "halves": False} if what == BACKWARDS else {}
            moved = _said(other, seen, blind, mv, **how)
            for name, before, after in zip((*blind, *mv), whole if how else plain, moved, strict=True):
                if what == BACKWARDS and not registry.load(name).METHOD.reversible:
                    continue
                kind = "same" if before == after else "open" if NO_DECISION in (before, after) else "flip"
                for key in (what, name):
                    asked[key, ""] += 1
                    found[key, kind] += 1
    table_rows: list[dict[str, object]] = []
    for key in (*TRANSFORMATIONS, *names):
        n, opened = asked[key, ""], found[key, "open"]
        if n:
            row = {"": key, "n": n, "flips": found[key, "flip"], "to or from no decision": f"{opened} ({opened / n:.2%})"}
            table_rows.append(row)
    return table_rows


def main(arguments: list[str] | None = None) -> int:
    """Print the table: `python -m results.studies.invariance`."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.invariance", description=__doc__)
    parser.add_argument("-n", type=int, default=250, help="loops of either grid, chapter and plant")
    chosen = parser.parse_args(arguments)
    print(f"{chosen.n} loops of chapter and of plant, seed {SEED}, at 1000 samples a period or more")
    print("flips: stiction against no stiction")
    print("\n".join(table(rows({"chapter": chosen.n, "plant": chosen.n}))))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))
