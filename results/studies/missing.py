"""Is what no known effect explains none, or something unknown? `python -m results.studies.missing`
learns on the building sites of `worlds.recipes` how much residual tests and the distance from the
baseline as given tell, and how much probability answers must have together so that nine records in
ten have the truth among them; it judges by the other sites.

What is learned stands in `simbench.gap.thresholds`. The weights come from records of which no
effect has most of the probability, with as much weight on records without an effect as on the
others; the probability of a set comes from all records (split conformal prediction: Vovk, Gammerman
and Shafer 2005).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.optimize import minimize
from scipy.special import expit, logit

from results.studies.withheld.sites import ask_sites, diagnosed
from results.studies.withheld.world import right_names
from results.studies.worlds import recipes
from simbench.bench.statistics import auc, rate
from simbench.gap.decide.posterior import TESTED
from simbench.gap.diagnosis import weigh_evidence
from simbench.gap.report.result import CONFIDENCE
from simbench.gap.thresholds import COVERED
from simbench.loop.effects import NONE, UNKNOWN
from simbench.usage import exit_code

OPEN = 0.3  # probability of none and unknown together, from which a record teaches
ACCUSED = 1.0 / 40.0  # share of records without an effect, at which it is counted what is found
_PULL = 0.5  # towards 0, of a weight in log-odds
NAMES = ("constant", "tested", "distance")


def asked(seed: int, i: int, entry: dict) -> dict[str, object]:
    """Return what one record shows, the site's part, and what is true; nothing of a record that is
    refused.
    """
    item = recipes.draw(seed, i, entry)
    report = diagnosed(item)
    if report is None:
        return {}
    found = report.behind.found
    before = weigh_evidence(found).probability
    true = right_names(item.answer)
    ranked = np.array([r.probability for r in report.ranking])
    likelier = np.cumsum(ranked) - ranked
    return {
        "part": recipes.part(recipes.site_of(item.answer)),
        "kind": item.answer["kind"],
        "none": before[NONE],
        "unknown": before[UNKNOWN],
        "apart": report.behind.loops.gap_as_given(found.load),
        "answer": 1.0 - next(r.probability for r in report.ranking if r.effect == NONE),
        "likelier": likelier[[r.effect in true for r in report.ranking]].min(),
        "size": int(np.sum(likelier < COVERED)),
    }


def regressors(rows: pd.DataFrame) -> np.ndarray:
    """Return a constant, tests and distance as `chance_of_unknown` weighs them, shape (n, 3)."""
    none, unknown, apart = (rows[k].to_numpy(dtype=float) for k in ("none", "unknown", "apart"))
    tested = np.clip(unknown / (none + unknown), *TESTED)
    return np.column_stack([np.ones(len(rows)), logit(tested), np.log(apart)])


def learned(rows: pd.DataFrame) -> np.ndarray:
    """Return the weights that rows teach in which no effect has most of the probability."""
    open_ = rows.loc[rows.none + rows.unknown > OPEN]
    lacks = (open_.kind != NONE).to_numpy()
    weight = np.where(lacks, 0.5 / lacks.mean(), 0.5 / (~lacks).mean())
    x, sign = regressors(open_), np.where(lacks, 1.0, -1.0)

    def cost(w: np.ndarray) -> float:
        pull = 0.5 * _PULL * float(w[1:] @ w[1:])
        return float(weight @ np.logaddexp(0.0, -sign * (x @ w))) + pull

    return minimize(cost, np.zeros(len(NAMES))).x


def covering(likelier: np.ndarray) -> float:
    """Return the probability that answers must have together so that as many records as are to be
    sure have the truth among them, of each record's probability of what is likelier than the truth.
    """
    rank = min(int(np.ceil(CONFIDENCE * (likelier.size + 1))), likelier.size)
    return float(np.sort(likelier)[rank - 1])


def found(of: np.ndarray, healthy: np.ndarray) -> float:
    """Return the share of records above what one healthy record in forty exceeds."""
    return float(np.mean(of > np.sort(healthy)[::-1][round(ACCUSED * healthy.size)]))


def table(rows: pd.DataFrame, weights: np.ndarray) -> pd.DataFrame:
    """Return AUC with its 95 % interval, and the share found, by kind and by what is asked."""
    rest, share = rows.none + rows.unknown, expit(regressors(rows) @ weights)
    asks = {
        "likelihood and tests": 1.0 - rows.none.to_numpy(),
        "distance alone": rows.apart.to_numpy(dtype=float),
        "parted by the distance": (1.0 - rest * (1.0 - share)).to_numpy(),
        "the answer": rows.answer.to_numpy(),
    }
    out = []
    healthy = (rows.kind == NONE).to_numpy()
    for kind in ("single", "two", "foreign"):
        here = (rows.kind == kind).to_numpy()
        for name, x in asks.items():
            area = auc(x[here | healthy], here[here | healthy])
            out.append(
                {
                    "kind": kind,
                    "asked": name,
                    "AUC": area.value,
                    "95 % interval": f"{area.lo:.2f} to {area.hi:.2f}",
                    "found": found(x[here], x[healthy]),
                    "n": int(here.sum()),
                    "without an effect": int(healthy.sum()),
                }
            )
    return pd.DataFrame(out)


def run(argv: Sequence[str] | None = None) -> int:
    """Draw, ask, learn and print."""
    given = ask_sites(asked, __doc__, argv, seed=960101, n=300)
    rows = pd.DataFrame([row for row in given.answers if row]).dropna(subset="apart")
    build, judge = (rows[rows.part == part] for part in ("build", "judge"))
    weights = learned(build)
    print(f"seed {given.seed}, n = {len(rows)}: {len(build)} to build on, {len(judge)} to judge by")
    print("weights: " + ", ".join(f"{n} {w:.2f}" for n, w in zip(NAMES, weights)))
    print("found: where one in forty of the records without an effect is accused")
    print(table(judge, weights).round(3).to_string(index=False))
    covered = rate(int((judge.likelier < COVERED).sum()), len(judge))
    print(f"probability of a set: {covering(build.likelier.to_numpy()):.3f}")
    print(
        f"with {COVERED:g}, {covered} of the sets to judge by hold the truth, and"
        f" {judge['size'].mean():.1f} answers in the mean"
    )
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(run))
