"""Do archives add confident verdicts? `python -m results.studies.plant.archives FOLDER` asks of
loops that hardly hum.

Loops of grid `plant`, two of three with a sound valve, their noise a three-thousandth to a
hundredth of PV's range: where noise is larger, what an archive leaves out is noise. Each is asked
about as it is and as twelve archives would have it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from results.studies.plant.recorded_loops import panel
from simbench.bench.scenario.resolve import resolve
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_STICTION, STICTION
from simbench.files import folder
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

SEED = 81  # the rule was made on loops of seed 80
NOISE = (-3.5, -2.0)  # powers of ten, of PV's range
LONGEST = 900  # samples


def quiet(number: int) -> tuple[LoopRecord, bool]:
    """Return the record of a number and whether its valve sticks, as every third does."""
    rng, source, wanted = np.random.default_rng([SEED, number]), load_grid("plant"), number % 3 == 2
    while True:
        members = list(resolve(source.group(int(rng.integers(source.group_count)))))
        scenario = members[int(rng.integers(len(members)))]
        if scenario.loop.valve.name != "ideal" and not wanted:
            continue
        try:
            table = scenario.loop.to_table()
            span = float(np.ptp(simulate(scenario.loop, scenario.seed).record.pv))
            table["noise"] = {"std": span * float(10.0 ** rng.uniform(*NOISE))}
            run = simulate(Loop.from_table(table, "quiet"), scenario.seed)
        except (UserError, SpecError):
            continue
        if run.sticky == wanted:
            record = replace(run.record.without_mv(), meta={})
            return record.window(max(record.n - LONGEST, 0), record.n), wanted


def main(arguments: list[str] | None = None) -> int:
    """Ask about every record and every archive, and print the verdicts that an archive added; goes
    on where it stopped.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.plant.archives", description=__doc__
    )
    parser.add_argument("out", type=Path, metavar="FOLDER", help="Where the answers are kept.")
    parser.add_argument("-n", type=int, default=30, help="Loops [30].")
    given = parser.parse_args(arguments)
    drawn = [(i, *quiet(i)) for i in range(given.n)]
    about = [
        (SimpleNamespace(id=f"quiet-{i}", label=STICTION if sticky else NO_STICTION), r)
        for i, r, sticky in drawn
    ]
    print("\n".join(panel(about, folder(given.out))[1:]))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
