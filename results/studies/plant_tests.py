"""Which tests on the plant tell most? `python -m results.studies.plant_tests` draws records of the
twenty sites of `worlds.recipes`, diagnoses each alone and then with one test of every kind, and
prints by kind how often the answer changes and what it is worth.

`gap plan` recommends first what stands out of the others (`simbench.gap.planning.order.ORDER`);
with some forty records of a kind these cannot be told apart.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from results.studies.withheld.files import write_item
from results.studies.withheld.on_plant import run_test
from results.studies.withheld.sites import ask_sites
from results.studies.withheld.world import right_names
from results.studies.worlds import recipes
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import Refusal, UserError
from simbench.gap.command import diagnose_files
from simbench.gap.planning.menu import Limits, size_test
from simbench.gap.planning.order import ORDER
from simbench.gap.report.result import GapReport
from simbench.loop.effects import NONE, UNKNOWN
from simbench.usage import exit_code

_LEAST = 1e-3  # probability of the truth, below which a logarithm counts as this


def said(report: GapReport, answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return what one answer is worth."""
    right = right_names(answer)
    return {
        "named": report.effect,
        "right": report.effect in right,
        "p": sum(r.probability for r in report.ranking if r.effect in right),
        "set": len(report.set),
        "accused": answer["kind"] == NONE and report.effect not in (NONE, UNKNOWN),
    }


def asked(seed: int, i: int, entry: dict) -> list[dict[str, Any]]:
    """Diagnose a record alone, and with one test of every kind where the answer asks for one;
    return a row of each kind.
    """
    item = recipes.draw(seed, i, entry)
    plant = item.answer | {"world": "recipes", "id": "record"}
    rows = []
    with TemporaryDirectory() as folder, one_thread():
        place = Path(folder)
        record, baseline = write_item(item, place, "record")
        try:
            alone = diagnose_files([record], baseline)
        except UserError:
            return []
        if alone.next_test is None:
            return []
        situation = alone.behind.found.situation
        for kind in ORDER:
            trial = size_test(kind, situation, {}, 0.0, Limits())
            if isinstance(trial, Refusal) or (kind == "mv" and situation.record.mv is not None):
                continue
            test = run_test(plant, trial, item.baseline, place)
            try:
                report = diagnose_files([record], baseline, tests=[str(test)])
            except UserError:
                report = alone
            before, after = said(alone, item.answer), said(report, item.answer)
            rows.append({"kind": kind, "healthy": item.answer["kind"] == NONE}
                        | {f"{k} before": v for k, v in before.items()} | after)  # fmt: skip
    return rows


def table(rows: pd.DataFrame) -> pd.DataFrame:
    """Return by kind of test what it is worth, that of most worth first."""
    out = {}
    for kind, of in rows.groupby("kind"):
        right, was = of.right.astype(bool), of["right before"].astype(bool)
        gain = of.p - of["p before"]
        logs = np.log(of[["p", "p before"]].clip(lower=_LEAST))
        out[kind] = {
            "n": len(of),
            "changed": int((of.named != of["named before"]).sum()),
            "made right": int((right & ~was).sum()),
            "made wrong": int((was & ~right).sum()),
            "p(truth)": gain.mean(),
            "+-": gain.std() / np.sqrt(len(of)),
            "ln p(truth)": (logs["p"] - logs["p before"]).mean(),
            "answers in set": (of["set"] - of["set before"]).mean(),
            "healthy": int(of.healthy.sum()),
            "named before": int(of["accused before"].sum()),
            "named after": int(of.accused.sum()),
        }
    return pd.DataFrame(out).T.sort_values("p(truth)", ascending=False)


def run(argv: Sequence[str] | None = None) -> int:
    """Draw, ask and print."""
    given = ask_sites(asked, __doc__, argv, seed=961301, n=60)
    rows = [row for some in given.answers for row in some]
    print(f"seed {given.seed}, n = {given.n}; a test where the answer alone asks for one")
    print(table(pd.DataFrame(rows)).round(3).to_string())
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(run))
