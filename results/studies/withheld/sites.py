"""Ask one question about every record that is drawn from the twenty sites of `recipes`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from joblib import delayed

from results.studies.withheld.making import Plan
from results.studies.worlds import recipes
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
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seed", type=int, default=seed)
    parser.add_argument("-n", type=int, default=n, help=f"records (default {n})")
    parser.add_argument("-j", type=int, default=-1, help="processes (default: all)")
    given = parser.parse_args(argv)
    entries = Plan.of(given.n).entries(list(recipes.FOREIGN))
    calls = [delayed(asked)(given.seed, i, entry) for i, entry in enumerate(entries)]
    return Asked(given.seed, given.n, run_parallel(calls, given.j, "records"))
