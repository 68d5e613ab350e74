"""Does the gain-change test tell a sticking valve from a sound one, on pairs of records?

`python -m results.studies.plant.gain_pairs` draws loops of three simulators, records each before
and after its controller gain is changed, with a sound valve and with one that sticks, and prints
what `confirm gain-change` says of the pairs that oscillate before, and of sticking valves after it
as well.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from results.studies.plant.stiction_probability import GRID, member
from results.studies.withheld.world import TestPlan
from results.studies.worlds import load_world
from simbench.bench.statistics import wilson
from simbench.confirm.expected import measure
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.gain_pair import gain_change_recorded
from simbench.loop.simulate import simulate
from simbench.progress import Progress
from simbench.scenarios.parts import Part
from simbench.usage import exit_code

SIMULATORS = ("own", "refinery", GRID)
RATIO = 0.6
S, J = 3.0, 1.5
LONGEST = 2000  # samples of a record


def pair(simulator: str, number: int, seed: int, sticks: bool) -> list[LoopRecord]:
    """Return the records of one loop before and after its gain is changed."""
    rng = np.random.default_rng([seed, SIMULATORS.index(simulator), number])
    if simulator == GRID:
        scenario, _ = member(GRID, 2 * number, rng)
        valve = Part(name="choudhury", parameters={"S": S, "J": J}) if sticks else None
        loop = scenario.loop.model_copy(update={"valve": valve or Part(name="ideal")})
        loop = loop.with_("sampling.n", min(loop.sampling.n, LONGEST))
        loops = [loop, loop.with_("controller.Kc", RATIO * loop.controller.Kc)]
        return [
            simulate(one, seed + i, kick=S if sticks else 0.0).record.without_mv()
            for i, one in enumerate(loops)
        ]
    world = load_world(simulator)
    item = world.draw(seed, number, {"kind": "none", "mv": False})
    effects = [{"effect": "stiction", "parameters": {"S": S, "J": J}}] if sticks else []
    n = min(item.columns["op"].size, LONGEST)
    out = []
    for i, ratio in enumerate((1.0, RATIO)):
        steady = TestPlan("kc", n, np.zeros(n), np.full(n, np.nan), Kc_ratio=ratio)
        columns = world.test(item.answer, effects, seed + i, steady)
        op, pv, sp = (np.asarray(columns[name]) for name in ("op", "pv", "sp"))
        Ts = float(columns["t"][1] - columns["t"][0])
        out.append(LoopRecord(op, pv, Ts, sp=sp, op_span=(0.0, 100.0)))
    return out


def main() -> int:
    """Draw, ask, and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-n", type=int, default=200, help="loops of each simulator [200]")
    parser.add_argument("--seed", type=int, default=6107, help="seed of the loops [6107]")
    parser.add_argument("--simulators", nargs="*", default=list(SIMULATORS), choices=SIMULATORS)
    options = parser.parse_args()
    for sticks in (False, True):
        print("sticking valves:" if sticks else "sound valves:")
        for simulator in options.simulators:
            counts: Counter[str] = Counter()
            for number in Progress(range(options.n), desc=simulator):
                try:
                    before, after = pair(simulator, number, options.seed, sticks)
                    phases = [measure(one.op, one.Ts, 1.0) for one in (before, after)]
                    # a cycle of friction goes on whatever the gain
                    seen = phases if sticks else phases[:1]
                    if any(not p.goes_on or p.saturated for p in seen):
                        counts["rests"] += 1
                        continue
                    counts[gain_change_recorded(before, after, RATIO).verdict] += 1
                except UserError:
                    counts["refused"] += 1
            print(line(simulator, counts))
    return 0


def line(simulator: str, counts: Counter[str]) -> str:
    """Return one row of the table."""
    rest = counts["rests"] + counts["refused"]
    n, claimed = sum(counts.values()) - rest, counts["stiction"]
    lo, hi = wilson(claimed, n) if n else (0.0, 1.0)
    return (
        f"  {simulator:<9} drawn {sum(counts.values())}, oscillate {n}: stiction {claimed}"
        f" ({lo:.2f} to {hi:.2f}), no stiction {counts['no_stiction']}, cannot tell"
        f" {counts['no_decision']}"
    )


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
