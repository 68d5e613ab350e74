"""What a comparison of two runs would have found, in sentences."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np
import pandas as pd
from scipy import optimize, stats

from simbench.bench.check.check_result import Check
from simbench.bench.score.quantification import MEDIAN_ERROR
from simbench.bench.statistics import mcnemar
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION

LEVEL = 0.05
# what is counted: among positives or negatives, which answers are good; "no decision" is neither
# right nor wrong
COUNTED = {
    "right": (None, ()),
    "detection": (True, (STICTION,)),
    "rejection": (False, (NO_STICTION,)),
    "no miss": (True, (STICTION, NO_DECISION)),
    "no false alarm": (False, (NO_STICTION, NO_DECISION)),
}
# a loss, of all the loops that a method covers, that must be found with `POWER`: where all records
# equal the baseline's bit for bit, and where some do not; where it is not, the check cannot tell
REACH = {"equal": 0.02, "other bits": 0.05}
# what a loss of each is called
LOST = {
    "right": "right answers",
    "detection": "detections",
    "rejection": "denials",
    "no miss": "misses",
    "no false alarm": "false alarms",
}


def points(share: float) -> str:
    """Return a share in percentage points."""
    return f"{100 * share:g} percentage point{'' if share == 0.01 else 's'}"


def smallest_seen(row: dict[str, Any], level: float, spared: float) -> float:
    """Return the smallest drop of a rate beyond what is `spared` that is found with `POWER`, where
    as many answers are won as here; NaN for an AUC and a median error.
    """
    if row["what"] in ("AUC", MEDIAN_ERROR) or row["n"] == 0:
        return float("nan")
    return smallest_loss_found(row["n"], level, int(row["won"]), int(spared * row["n"]))


def may_fall(row: dict[str, Any], level: float, spared: float) -> bool:
    """Return whether a rate would be found worse if all good answers before were lost."""
    if row["what"] not in COUNTED or row["n"] == 0:
        return False
    good = round(row["before"] * row["n"])
    return good > spared * row["n"] and mcnemar(good, 0, worse=True) < level


def unseen_losses(tests: pd.DataFrame, basis: str, changed: Collection[str]) -> Iterator[str]:
    """Name the methods that answer otherwise and have too few good answers before for any loss to
    be found, and those that lost answers of which nobody could have found a loss that matters: too
    few loops that they cover, or too many answers that changed both ways.
    """
    # whatever became of the answers that `changed`
    for method, rows in tests[tests["method"].isin(changed)].groupby("method", sort=False):
        right = rows[(rows["what"] == "right") & (rows["n"] > 0)]
        if len(right) and not rows["may_fall"].to_numpy().any():
            loops = right["n"].to_numpy()
            good = right["before"].to_numpy() * loops
            yield (
                f"{method}: no loss could be found with these loops: before, it was right on"
                f" {good.max():.0f} of the {loops.max()} that it covers, and to lose all of these"
                " may be chance"
            )

    # too few loops, or too many changes
    rates = tests[tests["what"].isin(COUNTED) & ~tests["worse"]]
    of_all = rates[rates["what"] == "right"].set_index(["method", "truth"])["n"]
    for method, rows in rates[rates["lost"] > 0].groupby("method", sort=False):
        if tests.loc[tests["method"] == method, "worse"].any():
            continue
        loops = np.array([of_all[method, truth] for truth in rows["truth"]])
        share = rows["seen"].fillna(1.0).to_numpy() * rows["n"].to_numpy() / np.maximum(loops, 1)
        worst = int(np.argmax(share))
        row = rows.iloc[worst]
        wanted = REACH[basis] * loops[worst] / max(rows.iloc[worst]["n"], 1)
        if not share[worst] <= REACH[basis]:
            yield (
                f"{method}: cannot tell on the {loops[worst]} loops that it covers: of"
                f" {LOST[row['what']]} ({row['truth']}) {row['lost']:.0f} were lost and"
                f" {row['won']:.0f} won, and only a loss of {points(round(row['seen'], 3))} would"
                f" have been found; {points(round(min(wanted, 1.0), 3))} are asked for"
            )


def say_power(tests: pd.DataFrame, basis: str) -> str:
    """Return which losses would have been found, and which must be, in a sentence."""
    if tests.empty:
        return "No method is in both, so no loss could be found"

    # the smallest loss found of each kind of answer, from the best method to the worst
    seen = tests[tests["truth"] == "cycled"].groupby("what")["seen"]
    ends = {}
    for what, x in seen:
        ends[what] = sorted({f"{100.0 * x:.1f}" for x in (x.min(), x.max())})

    # of detections and false alarms, and beside it the loss that must be found
    smallest = " and ".join(
        f"{' to '.join(ends[what])} of {LOST[what]}" for what in ("detection", "no false alarm")
    )
    return (
        f"In 8 of 10 such runs a loss of {smallest} would be found (percentage points, by method);"
        f" where answers are lost, one of {points(REACH[basis])} of all must be, else the check"
        " cannot tell"
    )


def loops_needed(check: Check) -> str:
    """Return how many loops a method must cover for a loss that matters to be found, in a
    clause.
    """
    tests = check.tests.groupby("method").size().max()
    needed = loops_for(REACH["equal"], LEVEL / tests)
    return f"for that a method must cover {needed} loops"


# --- How large a loss would a paired comparison have found? The power of the exact one-sided
# McNemar test that `check` makes, for as many answers as are won beside those that are lost.

POWER = 0.8  # with which a loss must be found


def smallest_loss_found(n: int, level: float, won: int = 0, least: int = 0) -> float:
    """Return the smallest net loss, a share of n answers, that a one-sided exact test at a level
    finds with `POWER` where about `won` answers are won beside it; 1 where none is.

    Answers lost and won are counts of Poisson; only more than `least` net ones fail, however sure.

    >>> round(smallest_loss_found(1000, 0.05), 4), round(smallest_loss_found(1000, 0.05, 40), 4)
    (0.0067, 0.0265)
    """
    if n == 0:
        return 1.0
    also_won = np.arange(stats.poisson.ppf(1e-6, won), stats.poisson.ppf(1.0 - 1e-6, won) + 1.0)
    chance = stats.poisson.pmf(also_won, won)
    needed = np.maximum(_least_lost(also_won, level), also_won + least + 1.0)

    def missed(share: float) -> float:
        """Return how far the power for a net loss is below what is asked for."""
        return POWER - float(chance @ stats.poisson.sf(needed - 1.0, won + n * share))

    if missed(1.0) > 0.0:
        return 1.0
    return float(optimize.brentq(missed, 0.0, 1.0, xtol=1e-5))


def loops_for(loss: float, level: float) -> int:
    """Return of how many answers a net loss is found where none is won beside it.

    >>> loops_for(0.0067, 0.05)
    1004
    """
    return math.ceil(stats.gamma.ppf(POWER, math.ceil(-math.log2(level))) / loss)


def _least_lost(won: np.ndarray, level: float) -> np.ndarray:
    """Return how many answers at least must be lost beside each number of won ones for the test to
    take them for a loss.
    """
    # by the normal approximation, then exactly
    z = stats.norm.isf(level)
    lost = np.floor(won + z * np.sqrt(2.0 * won) + 0.5 * z * z)
    while (low := stats.binom.sf(lost - 1.0, lost + won, 0.5) >= level).any():
        lost = lost + low
    while (high := stats.binom.sf(lost - 2.0, lost - 1.0 + won, 0.5) < level).any():
        lost = lost - high
    return lost
