"""Valve families: what a method finds of each, and what the tuned parts find of one that was left
out when they were fitted.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from results.studies.procedure_weights import fit
from simbench.bench.score.answers import home_of
from simbench.bench.score.quantification import estimates
from simbench.bench.statistics import wilson
from simbench.bench.store.reading import RunArrays, read_table
from simbench.detectors.evidence import EVIDENCE
from simbench.detectors.procedure import ODDS_HIGH
from simbench.detectors.report.report import table
from simbench.usage import exit_code

if TYPE_CHECKING:
    import pandas as pd

LIKE = "choudhury"  # the family every other is compared with, in the same cells
# cells are distinguished by their number: each part is judged with what was fitted on the others
PARTS = 2


def read(run: str | Path) -> pd.DataFrame:
    """Read a run of grid families as one row per scenario and method."""
    columns = [
        "scenario_id",
        "group",
        "process",
        "valve",
        "disturbance",
        "cycled",
        "oscillating",
        "tags",
    ]
    scenarios = read_table(run, "scenarios", columns).to_pandas()
    scenarios = scenarios[scenarios.cycled.isin(["yes", "no"])]
    scenarios = scenarios.assign(
        cycled=scenarios.cycled == "yes", S=[json.loads(t).get("S") for t in scenarios.tags]
    )
    columns = ["scenario_id", "method", "verdict", "score", "indices", "S_lo", "S_hi"]
    verdicts = read_table(run, "verdicts", columns).to_pandas()
    given = zip(verdicts.indices, verdicts.score, strict=True)
    verdicts = verdicts.assign(
        indices=[{**json.loads(i or "{}"), "score": score} for i, score in given]
    )
    return scenarios.drop(columns="tags").merge(
        verdicts.rename(columns={"verdict": "said"}), on="scenario_id"
    )


def left_out(rows: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Yield the procedure on every family, its weights fitted without that family and without the
    cells it is judged on.

    `rows`: as `read` gives it; with the methods that the procedure weighs.

    Keys: family, n; found, and found where the loop oscillates; less: how much less than of `LIKE`
    in the same cells, with its standard error; false alarms of the same weights.
    """
    loops = _evidence(rows)
    families = [v for v in dict.fromkeys(loops.valve) if loops[loops.valve == v].cycled.any()]
    for family in families:
        odds = _odds(loops, loops.valve != family)
        hit = loops.assign(hit=(odds >= ODDS_HIGH) & loops.oscillating)
        cycling = hit[hit.cycled]
        of_family, like = (
            cycling[cycling.valve == v].set_index("group").hit.astype(float) for v in (family, LIKE)
        )
        less = (like - of_family).dropna()
        seen = cycling[(cycling.valve == family) & cycling.oscillating]
        still = hit[~hit.cycled]
        yield {
            "family": family,
            "n": of_family.size,
            "found": float(of_family.mean()),
            "oscillating": seen.shape[0] / of_family.size,
            "found of these": float(seen.hit.mean()),
            "less than " + LIKE: float(less.mean()),
            "se": float(less.std() / max(less.size, 1) ** 0.5),
            "false alarms": float(still.hit.mean()),
        }


def sizes(books: Sequence[RunArrays]) -> Iterator[dict[str, object]]:
    """Yield how well S and J of each family are estimated over several draws of the grid.

    Keys: method, home (where its constants were fitted), parameter, family, n; median error and
    width in shares of the valve's S; held, of the intervals whose level is stated, and its 95 %
    interval.
    """
    import pandas as pd

    matches = pd.concat([estimates(book) for book in books])
    for key, rows in matches.groupby(["method", "parameter", "family"]):
        method, parameter, family = tuple(key)  # type: ignore[arg-type]
        held = rows.held.dropna()
        lo, hi = wilson(held.sum(), max(held.size, 1))
        ends = {
            "width": float(rows.width.median()),
            "held": float(held.mean()),
            "lo": float(lo),
            "hi": float(hi),
        }
        home = home_of(method, books[0])
        place = {
            "method": method,
            "home": home,
            "parameter": parameter,
            "family": family,
            "n": len(rows),
        }
        yield {
            **place,
            "median error": float(rows.error.median()),
            **(ends if held.size else dict.fromkeys(ends, "-")),
        }


def _evidence(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per scenario with what the procedure counts of it, x, by process type."""
    import pandas as pd

    evidence = []
    for _, part in rows.groupby("scenario_id", sort=False):
        indices = dict(zip(part.method, part.indices, strict=True))
        first = part.iloc[0]
        case = first.process == "integrating"
        values = [indices.get(e.method, {}).get(e.index) for e in EVIDENCE[case]]
        x = [
            min(max(v, e.low), e.high) - e.neutral if v is not None and np.isfinite(v) else 0.0
            for v, e in zip(values, EVIDENCE[case], strict=True)
        ]
        evidence.append({**first[["group", "process", "valve", "cycled", "oscillating"]], "x": x})
    return pd.DataFrame(evidence)


def _odds(loops: pd.DataFrame, allowed: pd.Series) -> np.ndarray:
    """Log-odds of every loop, by weights fitted on the allowed ones of other cells."""
    odds = np.zeros(len(loops))
    part = (loops.group % PARTS).to_numpy()
    for process in ("foptd", "integrating"):
        here = (loops.process == process).to_numpy()
        for k in range(PARTS):
            known = here & (part != k) & allowed.to_numpy() & loops.oscillating.to_numpy()
            asked = here & (part == k)
            bias, weights = fit(np.array(list(loops.x[known])), loops.cycled[known].to_numpy())
            odds[asked] = np.array(list(loops.x[asked])) @ weights + bias
    return odds


def main(arguments: list[str] | None = None) -> int:
    """Print tables of runs of grid families, the first of the first alone: `python -m
    results.studies.families RUN [RUN ...]`.
    """
    runs = sys.argv[1:] if arguments is None else arguments
    print("the procedure on each family, its weights fitted without it")
    print("\n".join(table(list(left_out(read(runs[0]))))))
    print(
        f"\nS and J of sticky valves, {len(runs)} draws of the grid: errors and widths in shares of"
        " the valve's S"
    )
    print("\n".join(table(list(sizes([RunArrays.read(run) for run in runs])))))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))
