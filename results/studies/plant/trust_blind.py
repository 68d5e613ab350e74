"""Does the detector that trust picks per loop beat the best one of all, on loops of simulators that are not ours?

`python -m results.studies.plant.trust_blind FOLDER -n 100` draws loops of the blind worlds, half of them with stiction, half
with another fault or none, asks trust about each record (no MV, no loop file), and prints who is right how often, with the
paired p-value against the best detector in hindsight. Answers are kept in the folder; it goes on where it stopped.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from tqdm import tqdm

from detectors.records.io import read_record
from results.studies.plant.stiction_probability import entry
from results.studies.plant.trust_claims import claimed, who_is_right
from simbench.blind.making import write_item
from simbench.blind.world import WORLDS
from simbench.files import answered, folder

SEED = 18  # loops of seeds 14 to 17 were looked at while rules were chosen


def asked(world: str, number: int) -> dict[str, Any]:
    """Return what trust says of one loop of a world, and whether it has friction."""
    item = WORLDS.load(world).draw(SEED, number, entry(number))
    with tempfile.TemporaryDirectory() as place:
        record = read_record(write_item(item, Path(place), "loop")[0])
    return {"sticky": number % 2 == 1, **claimed(record)}


def main() -> int:
    """Ask, and print who is right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="FOLDER")
    parser.add_argument("-n", type=int, default=100, help="loops [100]")
    parser.add_argument("--worlds", nargs="+", default=["refinery", "mill"])
    given = parser.parse_args()
    out, rows = folder(given.out), []
    for i in tqdm(range(given.n), file=sys.stderr):
        world = given.worlds[i // 2 % len(given.worlds)]
        rows.append(answered(out / f"{world}-{i}.json", lambda w=world, i=i: asked(w, i)))
    twins = sum(r["best"] is not None for r in rows)
    print(f"{len(rows)} loops of {', '.join(given.worlds)}, {sum(r['sticky'] for r in rows)} sticky; twins for {twins} of them")
    print("\n".join(who_is_right(rows)[1:]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
