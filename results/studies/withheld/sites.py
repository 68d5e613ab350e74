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
) -> Asked:
    """Read seed, number of records and processes off a command line, and ask about every record by
    the seed, its number and what it must hold.
    """
    given = options(about, seed, n).parse_args(argv)
    return Asked(given.seed, given.n, ask_drawn(asked, given, recipes))


def ask_drawn(
    asked: Callable[[int, int, dict], Any], given: argparse.Namespace, world: ModuleType
) -> list[Any]:
    """Return the answers to one question about every record of a world that was asked for."""
    entries = Plan.of(given.n).entries(list(world.FOREIGN))
    calls = [delayed(asked)(given.seed, i, entry) for i, entry in enumerate(entries)]
    return run_parallel(calls, given.j, "records")


def options(about: str | None, seed: int, n: int) -> argparse.ArgumentParser:
    """Return the command line of a study that asks about drawn records."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("-n", type=int, default=n, help=f"records (default {n})")
    parser.add_argument("-j", type=int, default=-1, help="processes (default: all)")
    return parser


def diagnosed(item: Item) -> GapReport | None:
    """Return the diagnosis of an item from its files; None where they are refused."""
    with TemporaryDirectory() as place, one_thread():
        record, baseline = write_item(item, Path(place), "record")
        try:
            return diagnose_files([record], baseline)
        except UserError:
            return None
