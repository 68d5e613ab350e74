"""What records of healthy operation are worth to the gap diagnosis, where loads and noise do by
themselves what an effect does: two worlds that share no code with it, asked with such records and
without.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
from joblib import Parallel, delayed

from results.studies.withheld.files import csv_of, write_item, write_whole
from results.studies.withheld.making import PLANTS, STRENGTHS
from results.studies.worlds import NAMES, load_world
from simbench.detectors.errors import UserError
from simbench.gap.command import diagnose_files
from simbench.loop.effects import NONE, UNKNOWN
from simbench.usage import exit_code

EFFECTS = ("load_drift", "load_steps", "oscillation", "noise", "drift")
MOST = 2  # healthy records of a loop
BUT_NAMED = "healthy, but named"
SEED = 24306367  # of the withheld checks as well; none of its records was looked at for this


def entries(each: int, none: int) -> list[dict[str, Any]]:
    """Return what every record must hold: each effect in each strength, and nothing."""
    single = [
        {"kind": "single", "effect": e, "strength": s, "mv": False, "plant": PLANTS[i % 3]}
        for e in EFFECTS
        for s in STRENGTHS
        for i in range(each)
    ]
    return single + [{"kind": NONE, "mv": False}] * none


def asked(world: str, i: int, entry: dict[str, Any]) -> list[dict[str, Any]]:
    """Draw one record and its healthy history, and return the answers with 0, 1 and 2 of it."""
    drawn_by = load_world(world)
    item = drawn_by.draw(SEED, i, entry)
    rows = []
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        history = [Path(place) / f"healthy{k}.csv" for k in range(MOST)]
        for k, file in enumerate(history):
            seed = int(item.answer["seed"]) + 1 + k
            write_whole(file, csv_of(drawn_by.simulate(item.answer, [], seed)))
        for count in range(MOST + 1):
            try:
                said = diagnose_files([record], baseline, healthy=history[:count]).effect
            except UserError as error:
                said = f"refused: {error}"
            about = {"world": world.rpartition(".")[2], "true": item.answer["effect"]}
            rows.append({**about, "n": count, "said": said})
    return rows


def table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return how many of each effect are named rightly by number of healthy records, and how many
    healthy loops are named.
    """
    frame = pd.DataFrame(rows)
    named = ~frame.said.isin([NONE, UNKNOWN])
    frame["count"] = (frame.said == frame.true).where(frame.true != NONE, named)
    frame["what"] = frame.true.map(lambda e: BUT_NAMED if e == NONE else f"{e}, right")
    order = [*(f"{e}, right" for e in EFFECTS), BUT_NAMED]
    counts = frame.pivot_table("count", ["world", "what"], "n", "sum").astype(int)
    counts["of"] = frame[frame.n == 0].groupby(["world", "what"]).size()
    worlds = frame.world.unique()
    index = pd.MultiIndex.from_product([worlds, order], names=["world", "what"])
    return counts.reindex(index).rename(columns={k: f"{k} records" for k in range(MOST + 1)})


def total(counts: pd.DataFrame) -> str:
    """Return one sentence on all worlds: records with an effect named rightly, and others named."""
    accused = counts.index.get_level_values("what") == BUT_NAMED
    right, named = counts[~accused].sum(), counts[accused].sum()
    return (
        f"of {right['of']} records with an effect {right['0 records']}, {right['1 records']} and"
        f" {right['2 records']} are named rightly; of {named['of']} without {named['0 records']},"
        f" {named['1 records']} and {named['2 records']} are named"
    )


def main(arguments: list[str] | None = None) -> None:
    """Print the table: `python -m results.studies.healthy`."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.healthy", description=__doc__)
    parser.add_argument("-n", type=int, default=4, help="records of an effect in a strength (4)")
    parser.add_argument("--none", type=int, default=30, help="records without an effect (30)")
    parser.add_argument("-j", type=int, default=2, help="processes (2)")
    given = parser.parse_args(arguments)
    calls = [
        delayed(asked)(world, i, entry)
        for world in NAMES
        for i, entry in enumerate(entries(given.n, given.none))
    ]
    answers: list[Any] = list(Parallel(n_jobs=given.j)(calls))
    rows = [row for answer in answers for row in answer]
    print(f"seed {SEED}, no MV; answers with 0, 1 and 2 healthy records of the same loop")
    counts = table(rows)
    print(counts.to_string())
    print(total(counts))


if __name__ == "__main__":
    sys.exit(exit_code(main))
