"""Invariance: dense loops judged again in another unit, sign, time or sampling; how often a verdict
changes.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.detectors.contract.detector import THINNED, backwards, turned
from simbench.detectors.judge import answers, judge
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import DENSEST, Prepared, prepare, thinned
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.report import table
from simbench.detectors.signal.oscillation import Oscillation
from simbench.detectors.verdict import NO_DECISION
from simbench.loop.simulate import simulate
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Scenario
from simbench.usage import exit_code

MOST = 64  # times as dense as in the grid; loops that need more are left out
UNIT, BACKWARDS = "unit of OP and PV", "read backwards"
SEED = 20131


def _scaled(record: LoopRecord) -> LoopRecord:
    a, b = 40.0, -300.0
    return replace(
        record,
        pv=0.02 * record.pv,
        op=a * record.op + b,
        op_span=(b, 100.0 * a + b),
        pv_span=None,
        sp=None if record.sp is None else 0.02 * record.sp,
    )


def _shifted(record: LoopRecord) -> LoopRecord:
    return replace(
        record,
        pv=record.pv + 2000.0,
        sp=None if record.sp is None else record.sp + 2000.0,
        pv_span=None,
    )


TRANSFORMATIONS: dict[str, Callable[[LoopRecord], LoopRecord]] = {
    UNIT: _scaled,
    "offset of PV": _shifted,
    "sign of both": turned,
    "unit of time": lambda r: replace(r, Ts=r.Ts / 3600.0),
    **{f"every {k} samples one": lambda r, k=k: thinned(r, k) for k in THINNED},
}


def dense_records(grids: dict[str, int], seed: int = SEED) -> Iterator[LoopRecord]:
    """Yield so many loops of each grid, spread over its groups; one sample of eight still gives 125
    a period.
    """
    for grid, wanted in grids.items():
        content = load_grid(grid, {"seed": seed, "repeats": 1})
        step = max(content.group_count // wanted, 1)
        places = (
            index for first in range(step) for index in range(first, content.group_count, step)
        )
        groups = ((index // step, resolve(content.group(index))) for index in places)
        yield from islice(
            filter(None, (_dense(group[k % len(group)]) for k, group in groups)), wanted
        )


def _dense(scenario: Scenario) -> LoopRecord | None:
    at, times = scenario.loop.sampling, max(THINNED)
    while times <= MOST:
        loop = scenario.loop.with_("sampling.Ts", at.Ts / times).with_("sampling.n", at.n * times)
        record = simulate(loop, scenario.seed).record
        # one sample of eight may oscillate where the dense record does not
        seen = [
            prepare(thinned(record.without_mv(), k)).oscillation.period_s for k in (1, max(THINNED))
        ]
        if not np.fmin(*seen) <= max(THINNED) * DENSEST / 2 * record.Ts:
            return replace(record, op_span=record.op_span or (0.0, 100.0))
        times *= 2
    return None


def _verdicts(
    record: LoopRecord, seen: LoopRecord, blind: list[str], mv: list[str], **how: bool
) -> list[str]:
    """Return the verdicts of methods that see OP and PV, then of those that see MV."""
    return [v.verdict for v in (*judge(record.without_mv(), blind, **how), *judge(seen, mv, **how))]


def _read(record: LoopRecord, oscillation: Oscillation, names: list[str]) -> list[str]:
    """Return the verdicts of methods on a whole record whose oscillation was detected forwards.

    A motion that sets in is an oscillation, one that dies out is none: the detection of
    oscillations depends on the direction of time.
    """
    blind = Prepared(record.without_mv())
    blind.__dict__["oscillation"] = oscillation
    sighted, verdicts = blind.with_mv(record), []
    for name in names:
        method = registry.load(name).METHOD
        verdicts.append(
            answers(name, sighted if method.needs_mv else blind, (True,), method.defaults())[0][
                0
            ].verdict
        )
    return verdicts


def rows(grids: dict[str, int], seed: int = SEED) -> tuple[list[dict[str, object]], list[str]]:
    """Return per transformation, and per method, how often verdicts change; and each flip in
    words.
    """
    names = registry.names()
    blind, mv = (
        [n for n in names if not registry.load(n).METHOD.needs_mv],
        [n for n in names if registry.load(n).METHOD.needs_mv],
    )
    reversible = [n for n in (*blind, *mv) if registry.load(n).METHOD.reversible]
    asked: Counter[tuple[str, str]] = Counter()
    counts: Counter[tuple[str, str]] = Counter()
    flips: list[str] = []
    for number, record in enumerate(dense_records(grids, seed)):
        verdicts = {"": _verdicts(record, record, blind, mv)}
        for what, change in TRANSFORMATIONS.items():
            # MV is in % whatever the unit of OP: the methods that see it keep OP's unit
            verdicts[what] = _verdicts(
                change(record), record if what == UNIT else change(record), blind, mv
            )
        pairs = [
            (what, name, a, b)
            for what in TRANSFORMATIONS
            for name, a, b in zip((*blind, *mv), verdicts[""], verdicts[what], strict=True)
        ]
        oscillation = Prepared(record.without_mv()).oscillation
        both = (_read(r, oscillation, reversible) for r in (record, backwards(record)))
        pairs += [(BACKWARDS, name, a, b) for name, a, b in zip(reversible, *both, strict=True)]
        for what, name, before, after in pairs:
            kind = (
                "same" if before == after else "open" if NO_DECISION in (before, after) else "flip"
            )
            flips += [f"loop {number}, {what}: {name} says {after} in place of {before}"] * (
                kind == "flip"
            )
            for key in (what, name):
                asked[key, ""] += 1
                counts[key, kind] += 1
    table_rows: list[dict[str, object]] = []
    for key in (*TRANSFORMATIONS, BACKWARDS, *names):
        n, opened = asked[key, ""], counts[key, "open"]
        if n:
            row = {
                "": key,
                "n": n,
                "flips": counts[key, "flip"],
                "to or from no decision": f"{opened} ({opened / n:.2%})",
            }
            table_rows.append(row)
    return table_rows, flips


def main(arguments: list[str] | None = None) -> int:
    """Print the table: `python -m results.studies.invariance`."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.invariance", description=__doc__
    )
    parser.add_argument("-n", type=int, default=250, help="loops of either grid, chapter and plant")
    parser.add_argument("--seed", type=int, default=SEED)
    chosen = parser.parse_args(arguments)
    print(
        f"{chosen.n} loops of chapter and of plant, seed {chosen.seed}, at 1000 samples a period or"
        " more"
    )
    print("flips: stiction against no stiction")
    table_rows, flips = rows({"chapter": chosen.n, "plant": chosen.n}, chosen.seed)
    print("\n".join([*table(table_rows), *flips]))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))
