"""Do verdicts change with the units of OP and PV? Records of two grids and of the blind check's
world, every method.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from results.studies.withheld.making import Plan
from results.studies.worlds import own as tank
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import Verdict
from simbench.scenarios.grid import load_grid

# What another transmitter, archive or sign convention would have sent: value = gain x + offset.
PV_MAPS = {
    "K": (1.0, 273.15),
    "F": (1.8, 32.0),
    "kPa": (100.0, 0.0),
    "bar": (0.01, 0.0),
    "psi": (14.503774, 0.0),
    "offset 1e5": (1.0, 1e5),
    "offset -1e5": (1.0, -1e5),
    "times 1e-6": (1e-6, 0.0),
    "times 1e6": (1e6, 0.0),
    "direct": (-1.0, 0.0),
    "direct from 100": (-1.0, 100.0),
}
OP_MAPS = {
    "0..1": (0.01, 0.0),
    "0..10 V": (0.1, 0.0),
    "4..20 mA": (0.16, 4.0),
    "3..15 psi": (0.12, 3.0),
    "0..4095": (40.95, 0.0),
}
GRIDS = ("chapter", "plant", "families")
SEED = 7


def records(count: int) -> Iterator[tuple[str, LoopRecord]]:
    """Return `count` records, from each grid and from the world `own` in turn."""
    sources = [_of_grid(name, -(-count // 4)) for name in GRIDS] + [_of_world(-(-count // 4))]
    for _ in range(-(-count // 4)):
        for source in sources:
            yield next(source)


def of_grid(name: str, index: int) -> LoopRecord:
    """Return the record of a scenario in a group of a grid, with the span of its OP."""
    group = resolve(load_grid(name).group(index))
    scenario = group[index % len(group)]
    run, _ = simulate_with_truth(scenario.loop, scenario.seed)
    return replace(run.record, op_span=(0.0, 100.0))


def _of_grid(name: str, count: int) -> Iterator[tuple[str, LoopRecord]]:
    for index in np.linspace(0, load_grid(name).group_count - 1, count).astype(int):
        yield f"{name} {index}", of_grid(name, int(index))


def _of_world(count: int) -> Iterator[tuple[str, LoopRecord]]:
    entries = Plan.of(400).entries(tuple(tank.FOREIGN))
    for index in np.linspace(0, len(entries) - 1, count).astype(int):
        item = tank.draw(SEED, int(index), entries[index])
        c = item.columns
        Ts = float(np.median(np.diff(c["t"])))
        yield (
            f"own {index}",
            LoopRecord(
                op=c["op"], pv=c["pv"], Ts=Ts, sp=c.get("sp"), mv=c.get("mv"), op_span=(0.0, 100.0)
            ),
        )


def mapped(record: LoopRecord) -> Iterator[tuple[str, LoopRecord]]:
    """Return the record in other units, by the name of the map."""
    for name, (gain, offset) in PV_MAPS.items():
        sp = None if record.sp is None else gain * record.sp + offset
        yield f"PV {name}", replace(record, pv=gain * record.pv + offset, sp=sp)
    for name, (gain, offset) in OP_MAPS.items():
        yield (
            f"OP {name}",
            replace(record, op=gain * record.op + offset, op_span=(offset, 100.0 * gain + offset)),
        )


def verdicts(record: LoopRecord) -> dict[tuple[str, str], Verdict]:
    """Return the verdict of every method, with and without the common front end."""
    return {
        (verdict.method, mode): verdict
        for mode, raw in (("front", False), ("raw", True))
        for verdict in judge(record, methods.names(), raw=raw)
    }


def changes(
    record: LoopRecord, maps: slice = slice(None)
) -> Iterator[tuple[str, str, str, Verdict, Verdict]]:
    """Yield map, method, mode and both verdicts wherever one of the maps changes the word or the
    applicability.
    """
    plain = verdicts(record)
    for name, other in list(mapped(record))[maps]:
        for (method, mode), after in verdicts(other).items():
            before = plain[method, mode]
            if (before.verdict, before.applicable) != (after.verdict, after.applicable):
                yield name, method, mode, before, after


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="records")
    count, changed = 0, 0
    for label, record in records(parser.parse_args().n):
        count += 1
        for name, method, mode, before, after in changes(record):
            changed += 1
            change = f"{before.verdict} {before.score:.9g} -> {after.verdict} {after.score:.9g}"
            print(
                f"{label:<14} {name:<20} {method:<16} {mode:<5} {change}   {after.reason[:90]}",
                flush=True,
            )
    pairs = count * (len(PV_MAPS) + len(OP_MAPS)) * len(methods.names()) * 2
    print(
        f"{count} records, {len(PV_MAPS)} units of PV and {len(OP_MAPS)} of OP: {changed} of"
        f" {pairs} verdicts changed"
    )
    return 1 if changed else 0


if __name__ == "__main__":
    raise SystemExit(main())
