"""What each rule of the diagnosis is worth on records drawn after it was written: the answers with
all rules, and without one at a time.

A rule stays only if it changes at least one answer of a hundred, for the better (CONTRIBUTING).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import pandas as pd
from joblib import Parallel, delayed
from scipy.stats import binomtest

from results.studies.withheld.files import write_item
from results.studies.withheld.making import Plan
from results.studies.withheld.world import right_names
from results.studies.worlds import NAMES, load_world, recipes
from simbench.detectors.errors import UserError
from simbench.gap.command import diagnose_files
from simbench.usage import exit_code

SITES = "recipes"
LEAST, SURE = 0.01, 0.05  # share of answers that a rule changes, and p of the test
ALL = "all rules"


# each rule, and what stands in its place when it is off
RULES: dict[str, dict[str, Any]] = {
    "something unknown is likelier where the simulation stays far": {
        "simbench.gap.decide.posterior.Posterior.afar": lambda self, *_: self
    },
    "a lag that MV shows is a gap only where PV answers MV": {
        "simbench.gap.decide.assess.NOT_IN_PLANT": "off"
    },
    "archive and controller may be a sample apart": {
        "simbench.gap.controller.pi_law.best_aligned": lambda examined, pv, sp: examined(pv, sp)
    },
    "a law behind a mean of the archive's": {
        "simbench.gap.controller.pi_law._Examination._behind_a_mean": lambda self, law: None
    },
    "exact terms: derivative, missed executions, frozen sensor": {
        f"simbench.gap.effects.{name}.shown": lambda s, term: None
        for name in ("derivative_action", "missed_executions", "frozen_sensor")
    },
}


@contextmanager
def without(rule: str) -> Iterator[None]:
    """Turn one rule off while the block lasts."""
    with ExitStack() as stack:
        for name, instead in RULES.get(rule, {}).items():
            stack.enter_context(patch(name, instead))
        yield


def asked(
    world: str, seed: int, i: int, entry: dict[str, Any], rules: Sequence[str]
) -> dict[str, Any]:
    """Draw one record, and return its truth and the answer with all rules and without each; a
    foreign effect that the library knows after all is named rightly by its own name alone.
    """
    item = load_world(world).draw(seed, i, entry)
    row: dict[str, Any] = {"true": right_names(item.answer)}
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        for rule in (ALL, *rules):
            try:
                with without(rule):
                    row[rule] = diagnose_files([record], baseline).effect
            except UserError as error:
                row[rule] = f"refused: {error}"
    return row


def table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return of every rule how many answers it changes, how many are right with it alone and
    without it alone, the one-sided p (McNemar 1947), and whether it stays.
    """
    out = []
    for rule in (rule for rule in RULES if rule in rows[0]):
        pairs = [(row[ALL], row[rule], row["true"]) for row in rows]
        changed = sum(a != b for a, b, _ in pairs)
        better = sum(a in true and b not in true for a, b, true in pairs)
        worse = sum(b in true and a not in true for a, b, true in pairs)
        p = binomtest(better, better + worse, alternative="greater").pvalue if better + worse else 1
        stays = changed >= LEAST * len(rows) and p <= SURE
        out.append((rule, changed, better, worse, f"{p:.3f}", "stays" if stays else "goes"))
    names = ["rule", "changed", "right with it", "right without", "p", "verdict"]
    return pd.DataFrame(out, columns=names)


def drawn(n: int) -> list[tuple[str, int, dict]]:
    """Return world, number and entry of n records of each world; of the sites, those that judge."""
    out = []
    for world in (*NAMES, SITES):
        entries = Plan.of(2 * n if world == SITES else n).entries(list(load_world(world).FOREIGN))
        out += [
            (world, i, entry)
            for i, entry in enumerate(entries)
            if world != SITES or recipes.part(recipes.site_at(i)) == "judge"
        ]
    return out


def main(arguments: list[str] | None = None) -> None:
    """Print the table: `python -m results.studies.admission --seed SEED`."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.admission", description=__doc__
    )
    parser.add_argument("--seed", type=int, required=True, help="named after the rule was written")
    parser.add_argument("-n", type=int, default=100, help="records of each world (100)")
    parser.add_argument("--rule", action="append", help="judge the rules that begin so (all)")
    parser.add_argument("-j", type=int, default=2, help="processes (2)")
    given = parser.parse_args(arguments)
    rules = [rule for rule in RULES if rule.startswith(tuple(given.rule or [""]))]
    calls = [
        delayed(asked)(world, given.seed, i, entry, rules) for world, i, entry in drawn(given.n)
    ]
    rows = Parallel(n_jobs=given.j)(calls)
    print(f"{len(rows)} records of three worlds, seed {given.seed}")
    print(table(list(rows)).to_string(index=False))


if __name__ == "__main__":
    sys.exit(exit_code(main))
