"""Ask one question about every record that is drawn from twenty sites, `recipes` or others."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, NamedTuple

from joblib import delayed

from results.studies.withheld.files import write_item
from results.studies.withheld.making import Plan
from results.studies.withheld.world import Item
from results.studies.worlds import recipes
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.gap.command import diagnose_files
from simbench.gap.report.result import GapReport
from simbench.parallel import run_parallel


class Asked(NamedTuple):
    """What was asked for, and the answers, in the order of the records."""

    seed: int
    n: int
    answers: list[Any]


def ask_sites(
    asked: Callable[[int, int, dict], Any],
    about: str | None,
    argv: Sequence[str] | None,
    seed: int,
    n: int,
    world: ModuleType = recipes,
) -> Asked:
    """Read seed, number of records and processes off a command line, and ask about every record by
    the seed, its number and what it must hold.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("-n", type=int, default=n, help=f"records (default {n})")
    parser.add_argument("-j", type=int, default=-1, help="processes (default: all)")
    given = parser.parse_args(argv)
    entries = Plan.of(given.n).entries(list(world.FOREIGN))
    calls = [delayed(asked)(given.seed, i, entry) for i, entry in enumerate(entries)]
    return Asked(given.seed, given.n, run_parallel(calls, given.j, "records"))


def diagnosed(item: Item) -> GapReport | None:
    """Return the diagnosis of an item from its files; None where they are refused."""
    with TemporaryDirectory() as place, one_thread():
        record, baseline = write_item(item, Path(place), "record")
        try:
            return diagnose_files([record], baseline)
        except UserError:
            return None
