"""Compare detectors on the same scenarios: between methods of one run, or method by method between
two runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from simbench.bench.score.answers import axis_codes, home_of
from simbench.bench.score.baseline import read_book
from simbench.bench.score.pairing import pair
from simbench.bench.score.shipped import with_shipped
from simbench.bench.statistics import holm, mcnemar, mean_ranks, rate
from simbench.bench.store.benchmark import refuse_other_benchmark
from simbench.bench.store.reading import TRUTHS, RunArrays, RunError
from simbench.detectors.errors import UserError, nearest

_LEVEL = 0.05
_WORKING_ACCURACY = 0.8  # accuracy below this counts as broken down
_ALONE = ("nonlinearity", "quantification", "oracle")  # roles that are compared, but not ranked


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Who answers better, and where."""

    truth: str  # the label answers are compared with
    cases: int  # scenarios both sides judged
    # method, n (scenarios it applies to), accuracy over those with interval (lo, hi), mean_rank (1
    # = best, ties shared; NaN for what is not ranked: methods that see MV or are made for a part of
    # the scenarios), home (where its constants were fitted), best first
    ranking: pd.DataFrame
    # mean ranks closer than this cannot be told apart (group bootstrap, 5 %); NaN between two runs
    # or for fewer than 3 methods
    critical_difference: float
    # first, second, only_first, only_second (scenarios that both apply to and only one got right),
    # p (exact McNemar, Holm-corrected), differ
    pairs: pd.DataFrame
    by_axis: pd.DataFrame  # method, axis, value, n, accuracy, lo, hi
    # method, axis, value, accuracy, lo, hi: the first value of the axis at which accuracy is below
    # 0.8
    breakdown: pd.DataFrame

    def as_text(self) -> str:
        """Return ranking, which methods differ from the best (or between two runs), and breakdowns,
        for a terminal.
        """
        lines = [
            f"{self.cases} scenarios, right against {self.truth!r}, with 95 % intervals",
            _text(self.ranking),
        ]
        if not np.isnan(self.critical_difference):
            lines += [
                f"mean ranks closer than {self.critical_difference:.2f} cannot be told apart (group"
                " bootstrap, 5 %)"
            ]
        differ = self.pairs[self.pairs["differ"]].drop(columns="differ")
        alike = len(self.pairs) - len(differ)
        lines += [
            "",
            (
                f"{len(differ)} pairs differ (exact McNemar, Holm-corrected p < {_LEVEL:g}),"
                f" {alike} do not"
            ),
        ]
        ranked = self.ranking.dropna(subset=["mean_rank"])
        best = (ranked if len(ranked) else self.ranking)["method"].iloc[0]
        shown = differ[
            differ["first"].eq(best)
            | differ["second"].eq(best)
            | ~differ["second"].isin(self.ranking["method"])
        ]
        lines += [_text(shown)] if len(shown) else []
        if len(self.breakdown):
            cell = self.breakdown.assign(
                at=[
                    f"{v} ({a:.2f})"
                    for v, a in zip(self.breakdown["value"], self.breakdown["accuracy"])
                ]
            )
            wide = cell.pivot(index="method", columns="axis", values="at").reindex(
                self.ranking["method"]
            )
            lines += [
                "",
                (
                    f"first value of each axis with accuracy below {_WORKING_ACCURACY:g}, and the"
                    " accuracy there"
                ),
            ]
            lines += [
                wide.dropna(how="all")
                .rename_axis(columns=None)
                .reset_index()
                .to_string(index=False, na_rep="-")
            ]
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN becomes null."""
        cd = None if np.isnan(self.critical_difference) else self.critical_difference
        tables = {
            name: plain(getattr(self, name))
            for name in ("ranking", "pairs", "by_axis", "breakdown")
        }
        return {"truth": self.truth, "cases": self.cases, "critical_difference": cd, **tables}


def compare(
    folder: str | Path, other: str | Path | None = None, truth: str = "cycled"
) -> _Comparison:
    """Compare the methods of a run with each other, or with themselves in another run.

    An answer is right when it is the label; "no decision" is never right. Where a method does not
    apply it is not compared. McNemar (1947), Holm (1979), Demsar (2006).
    """
    if truth not in TRUTHS:
        raise UserError(f"truth {truth!r} is unknown: {nearest(truth, TRUTHS)}")
    book = read_book(folder)
    if other is None:
        return between_methods(with_shipped(book), truth)
    theirs = read_book(other)
    refuse_other_benchmark(book.manifest, theirs.manifest, pair(book, theirs).now.size)
    return between_runs(book, theirs, truth)


def between_methods(book: RunArrays, truth: str = "cycled") -> _Comparison:
    """Compare all methods of a run pairwise; see `compare`."""
    use = book.truth[truth] >= 0
    right, applies = _right(book, truth)[:, use], _applies(book)[:, use]
    names = np.array(book.methods)
    rows = []
    for i, j in combinations(range(len(names)), 2):
        one, other = (right[k, applies[i] & applies[j]] for k in (i, j))
        rows.append((names[i], names[j], int((one & ~other).sum()), int((~one & other).sum())))
    about = [book.manifest["methods"][m] for m in book.methods]
    alike = np.array([a["role"] not in _ALONE and not a["needs_mv"] for a in about])
    ranked = applies.all(axis=1) & alike
    ranks, cd = np.full(len(names), np.nan), float("nan")
    if ranked.sum() >= 3 and right.shape[1] >= 2:
        found = mean_ranks(right[ranked].T, groups=book.groups[use])
        ranks[ranked], cd = found.mean_rank, found.critical_difference
    return _comparison(book, truth, right, applies, ranks, cd, rows)


def between_runs(book: RunArrays, other: RunArrays, truth: str = "cycled") -> _Comparison:
    """Compare every method with itself in another run; see `compare`. `first` is this run, `second`
    the other.
    """
    at, other_at, *_ = pair(book, other)
    common = [m for m in book.methods if m in other.methods]
    if not common:
        raise RunError("the two runs have no method in common; one is needed")
    use = (book.truth[truth][at] >= 0) & (other.truth[truth][other_at] >= 0)
    right, theirs = (
        _right(book, truth)[:, at][:, use],
        _right(other, truth)[:, other_at][:, use],
    )
    applies, apply = _applies(book)[:, at][:, use], _applies(other)[:, other_at][:, use]
    rows = []
    for method in common:
        i, j = book.methods.index(method), other.methods.index(method)
        mine, its = (found[k, applies[i] & apply[j]] for found, k in ((right, i), (theirs, j)))
        rows.append(
            (method, f"{method} (other run)", int((mine & ~its).sum()), int((~mine & its).sum()))
        )
    return _comparison(
        book, truth, right, applies, np.full(len(book.methods), np.nan), float("nan"), rows
    )


def _breakdowns(by_axis: pd.DataFrame) -> pd.DataFrame:
    """Return, for every method and axis, the first value at which accuracy is below 0.8."""
    low = by_axis[by_axis["accuracy"] < _WORKING_ACCURACY]
    return (
        low.groupby(["method", "axis"], sort=False)
        .head(1)
        .sort_values(["method", "axis"], kind="stable", ignore_index=True)
    )


def plain(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a table's rows as JSON types; NaN becomes null."""
    return frame.astype(object).where(frame.notna(), None).to_dict("records")


def _right(book: RunArrays, truth: str) -> np.ndarray:
    return book.verdict == book.truth[truth]


def _applies(book: RunArrays) -> np.ndarray:
    return book.applicable != 0  # what the record does not tell counts as applying


def _comparison(
    book: RunArrays,
    truth: str,
    right: np.ndarray,
    applies: np.ndarray,
    ranks: np.ndarray,
    cd: float,
    rows: list[tuple],
) -> _Comparison:
    cases = right.shape[1]
    accuracy = [
        (int(a.sum()), *rate(int(r[a].sum()), int(a.sum()))) for r, a in zip(right, applies)
    ]
    ranking = pd.DataFrame(accuracy, columns=["n", "accuracy", "lo", "hi"]).assign(mean_rank=ranks)
    ranking.insert(0, "method", book.methods)
    ranking["home"] = [home_of(method, book) for method in book.methods]
    pairs = pd.DataFrame(rows, columns=["first", "second", "only_first", "only_second"])
    pairs["p"] = holm([mcnemar(lost, won) for _, _, lost, won in rows])
    pairs["differ"] = pairs["p"] < _LEVEL
    by_axis = pd.DataFrame(
        _by_axis(book, truth), columns=["method", "axis", "value", "n", "accuracy", "lo", "hi"]
    )
    ranking = ranking.sort_values("accuracy", ascending=False, kind="stable", ignore_index=True)
    return _Comparison(truth, cases, ranking, cd, pairs, by_axis, _breakdowns(by_axis))


def _by_axis(book: RunArrays, truth: str) -> Iterator[tuple]:
    right, known = _right(book, truth), _applies(book) & (book.truth[truth] >= 0)
    for axis in book.along:
        values, codes = axis_codes(book, axis)
        for k, value in enumerate(values):
            chosen = codes == k
            for method, row, mine in zip(book.methods, right, known):
                use = chosen & mine
                if use.any():
                    yield (
                        method,
                        axis,
                        value,
                        int(use.sum()),
                        *rate(int(row[use].sum()), int(use.sum())),
                    )


def _text(frame: pd.DataFrame) -> str:
    return frame.to_string(index=False, float_format=lambda x: f"{x:.3g}", na_rep="-")
