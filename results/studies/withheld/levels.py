"""Score a blind test of the gap diagnosis: rates, medians and calibration over many answers, and
whether they reach the required levels.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

_SAMPLE_LEVEL = frozenset({"noise", "quantisation", "compression", "outliers"})
_COUNTED = ("medium", "strong")
"""Strengths the levels are for; weak is shown, too."""


def _holds(figure: Share | Figure) -> bool | None:
    """Whether the level is reached; None without level or value."""
    if figure.value is None or figure.level is None:
        return None
    return figure.value <= figure.level if figure.at_most else figure.value >= figure.level


@dataclass(frozen=True)
class Share:
    """k of n with its 95 % Wilson interval, and the level it must reach."""

    name: str
    k: int
    n: int
    level: float | None = None
    at_most: bool = False

    @property
    def value(self) -> float | None:
        """k / n, None without records."""
        return self.k / self.n if self.n else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson (1927) 95 % interval."""
        if not self.n:
            return 0.0, 1.0
        ci = stats.binomtest(self.k, self.n).proportion_ci(method="wilson")
        return float(ci.low), float(ci.high)

    holds = property(_holds)

    def row(self) -> dict[str, Any]:
        """Return the share as one row of a table."""
        lo, hi = self.interval
        return asdict(self) | {"value": self.value, "lo": lo, "hi": hi, "holds": self.holds}


@dataclass(frozen=True)
class Figure:
    """A figure that is no share: a median, a correlation, an error."""

    name: str
    value: float | None
    n: int
    level: float | None = None
    at_most: bool = False

    holds = property(_holds)

    def row(self) -> dict[str, Any]:
        """Return the figure as one row of a table."""
        return asdict(self) | {"holds": self.holds}


def calibration_error(stated: np.ndarray, right: np.ndarray, bins: int = 10) -> float:
    """Return the expected calibration error (Naeini et al. 2015), equal-width bins."""
    place = np.minimum((stated * bins).astype(int), bins - 1)
    return float(
        sum(
            abs(right[place == b].mean() - stated[place == b].mean()) * np.mean(place == b)
            for b in np.unique(place)
        )
    )


def levels(table: pd.DataFrame) -> list[Share | Figure]:
    """Return every figure that has a level, in the order in which they are printed."""
    counted = (
        _COUNTED
        if table.strength.isin(("weak", *_COUNTED)).any()
        else tuple(table.strength.unique())
    )
    single = table[(table.kind == "single") & table.strength.isin(counted)]
    none, two = table[table.kind == "none"], table[(table.kind == "two")]
    foreign = table[(table.kind == "foreign") & table.resolvable]
    valve = single[(single.block == "valve") & single.mv]
    named = table[~table.called_none & ~table.called_unknown & table.answered]
    near = {
        "all": table,
        "the right effect named": named[named["first"]],
        "a wrong one named": named[~named["first"]],
    }
    direct = single[(single.block == "controller") | single.effect.isin(_SAMPLE_LEVEL)]
    return [
        share("first answer right", single["first"], 0.85),
        share("right within its group", single.in_group, 0.95),
        share("among the first three", single.top3, 0.98),
        share("block right (within group)", single.block_right, 0.95),
        share("controller and sample-level effects", direct["first"], 0.97),
        share("valve effects with MV", valve["first"], 0.92),
        share(
            "effect named where there is none",
            ~none.called_none & ~none.called_unknown & none.answered,
            0.05,
            at_most=True,
        ),
        share("none called unknown", none.called_unknown),
        share("two effects: both among the first three", two.both_top3, 0.75),
        share("two effects: exactly these two named", two.both_named),
        share("two effects: the first named is one of them", two.one_of_two),
        share(
            "foreign: unknown or the library's name, of the resolvable", foreign["first"], 0.75
        ),  # or called by its name
        share("foreign: block right, of the resolvable", foreign.block_right),
        share("known effect called unknown", single.called_unknown, 0.03, at_most=True),
        share("known effect called none", single.called_none),
        share("not answered", ~table.answered),
        *(
            share(f"within 1.5 plant floors {when}, {which}", part[f"near_{when}"].dropna())
            for which, part in near.items()
            for when in ("before", "after")
        ),
        median("claimed shrinkage of the true group, median", single.claim_right, 0.7),
        median(
            "claimed shrinkage of the best wrong group, median",
            single.claim_wrong,
            0.2,
            at_most=True,
        ),
        rank(
            "rank correlation of claimed with true shrinkage",
            single.shrinkage_claimed,
            single.shrinkage_true,
            0.8,
        ),
        calibration(table),
        median(
            "parameters of the right effect, median error",
            single.parameter_error,
            0.10,
            at_most=True,
        ),
    ]


def by_effect(table: pd.DataFrame) -> pd.DataFrame:
    """Return first / group / top-3 / block / unknown / none shares per effect (or foreign kind) and
    strength.
    """
    rows = []
    what = table.effect.where(table.kind != "foreign", "foreign: " + table.foreign).where(
        table.kind != "two", "two effects"
    )
    for cell, part in table.groupby([table.kind, what, table.strength.replace("", "all")]):
        kind, effect, strength = cell  # type: ignore[misc]
        for measure in (
            "first",
            "in_group",
            "top3",
            "block_right",
            "called_unknown",
            "called_none",
            "both_top3",
        ):
            counted = share(measure, part[measure]).row()
            about = {"kind": kind, "effect": effect, "strength": strength, "measure": measure}
            rows.append(about | {k: counted[k] for k in ("k", "n", "value", "lo", "hi")})
    return pd.DataFrame(rows)


def share(
    name: str, hits: Iterable[bool], level: float | None = None, at_most: bool = False
) -> Share:
    """Return how many of `hits` are true as a share."""
    values = [bool(x) for x in hits]
    return Share(name, sum(values), len(values), level, at_most)


def calibration(table: pd.DataFrame) -> Figure:
    """Return the expected calibration error of the named effect's probability (Naeini et al. 2015),
    equal-width bins.
    """
    part = table[table.answered & (table.kind != "two")]
    pair = part.probability.to_numpy(float), part["first"].to_numpy(float)
    error = calibration_error(*pair) if len(part) else None
    return Figure("expected calibration error", error, len(part), 0.05, at_most=True)


def median(
    name: str, values: pd.Series, level: float | None = None, at_most: bool = False
) -> Figure:
    """Return the median of what is known."""
    known = values.dropna().astype(float)
    return Figure(name, float(known.median()) if len(known) else None, len(known), level, at_most)


def rank(name: str, x: pd.Series, y: pd.Series, level: float) -> Figure:
    """Return the rank correlation of two columns where both are known."""
    both = pd.DataFrame({"x": x, "y": y}).dropna().astype(float)
    if len(both) < 3 or both.x.nunique() < 2 or both.y.nunique() < 2:
        return Figure(name, None, len(both), level)
    return Figure(name, float(stats.spearmanr(both.x, both.y).statistic), len(both), level)
