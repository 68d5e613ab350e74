"""Compare the methods of a run on the same scenarios, every two of them, and the same loops of two
runs.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from simbench.bench.score.answers import failures, home_of
from simbench.bench.statistics import holm, mcnemar, rate
from simbench.bench.store.reading import TRUTHS, RunArrays
from simbench.detectors.errors import UserError, nearest
from simbench.detectors.views import page_part
from simbench.page.text import LINE_WIDTH, lines_of, wrap

_LEVEL = 0.05
_COUNTS = ("win", "tie", "loss")
_PAIR = ("first", "second", "n") + _COUNTS + ("p", "differ")


@dataclass(frozen=True, eq=False)
class Comparison:
    """Who answers better, and where.

    Parameters
    ----------
    truth : str
        The label answers are compared with.
    cases : int
        Scenarios with a label.
    ranking : DataFrame
        method, n (scenarios it applies to), accuracy over those with its 95 % interval
        (accuracy_lo, accuracy_hi), failed (records on which it raised an error, which count as
        wrong), home (where its constants were fitted); best first.
    pairs : DataFrame
        first, second, n scenarios to which both apply; win (only the first was right), tie (both
        or neither), loss (only the second); p (exact McNemar test, Holm-corrected over all pairs),
        differ (p below .05).
    """

    truth: str
    cases: int
    ranking: pd.DataFrame
    pairs: pd.DataFrame

    def matrix(self, what: str = "p") -> pd.DataFrame:
        """Return one number of every pair of methods, best method first.

        Parameters
        ----------
        what : str
            win (scenarios on which only the row's method was right), tie (both or neither), loss
            (only the column's), n (all three), or p (exact McNemar test, Holm-corrected).

        Returns
        -------
        DataFrame
            Methods by methods; NaN on the diagonal.

        Raises
        ------
        UserError
            For another word.
        """
        known = ("p",) + _COUNTS + ("n",)
        if what not in known:
            raise UserError(f"matrix {what!r}: {nearest(what, known)}")
        turned = {"win": "loss", "loss": "win"}.get(what, what)
        names = list(self.ranking["method"])
        table = pd.DataFrame(np.nan, names, names)
        for row in self.pairs.to_dict("records"):
            table.loc[row["first"], row["second"]] = row[what]
            table.loc[row["second"], row["first"]] = row[turned]
        return table

    def cells(self) -> pd.DataFrame:
        """Return every pair as text: above the diagonal win-tie-loss of the row's method, below it
        p, with a star where it is below .05.

        Returns
        -------
        DataFrame
            Methods by methods, best first.
        """
        numbers = {}
        for what in ("p",) + _COUNTS:
            numbers[what] = self.matrix(what).to_numpy()
        names = list(self.ranking["method"])
        p, wins, ties, losses = (numbers[what] for what in ("p",) + _COUNTS)
        text = np.full(p.shape, "", dtype=object)
        for i, j in combinations(range(len(names)), 2):
            if np.isfinite(p[i, j]):
                star = "*" if p[i, j] < _LEVEL else ""
                text[i, j] = f"{wins[i, j]:.0f}-{ties[i, j]:.0f}-{losses[i, j]:.0f}{star}"
                text[j, i] = _format_p(p[i, j]) + star
        return pd.DataFrame(text, names, names)

    def as_text(self) -> str:
        """Return how often each method is right, and all pairs, for a terminal."""
        # how often each method is right
        lines = [
            f"all {self.cases} loops with a label against {self.truth!r}, oscillating or not; share"
            " right with 95 % interval"
        ]
        lines += self._accuracy_lines()
        for row in self.ranking[self.ranking["failed"] > 0].itertuples():
            lines.append(
                f"! {row.method} failed on {row.failed} of {row.n} records, which count as wrong"
            )

        # the pairs
        differ = int(self.pairs["differ"].sum())
        lines += [
            "",
            f"{differ} of {len(self.pairs)} pairs differ (exact McNemar test, Holm-corrected p <"
            f" {_LEVEL:g})",
        ]
        return "\n".join(lines + (self._matrix_lines() if self.square else self._pair_lines()))

    @property
    def square(self) -> bool:
        """Whether every two methods are compared, so that their pairs fill a square table."""
        return 2 * len(self.pairs) == len(self.ranking) * (len(self.ranking) - 1)

    def listed(self) -> pd.DataFrame:
        """Return the pairs as text, a row each.

        Returns
        -------
        DataFrame
            First, Second, n, Win (only the first right), Tie, Loss, p with a star below .05.
        """
        p = [f"{_format_p(r.p)}{'*' * r.differ}" for r in self.pairs.itertuples()]
        shown = self.pairs.drop(columns=["p", "differ"]).assign(p=p).astype(str)
        return shown.rename(columns=lambda name: name if len(name) == 1 else name.capitalize())

    @property
    def legend(self) -> str:
        """What the cells of the square table, or the columns of the list, are."""
        if not self.square:
            return "win: only the first right; loss: only the second; *: they differ"
        return (
            "above the diagonal: win-tie-loss (only the row's method right, both or neither, only"
            " the column's); below it: p; *: they differ"
        )

    def _pair_lines(self) -> list[str]:
        """Return a line for every pair."""
        return [self.legend, ""] + lines_of(self.listed().rename(columns=str.lower))

    def _number_methods(self) -> list[str]:
        """Return the methods with a number, and a mark where one failed."""
        names = []
        for k, r in enumerate(self.ranking.itertuples(), 1):
            names.append(f"{k} {r.method}{'!' if r.failed else ''}")
        return names

    def _accuracy_lines(self) -> list[str]:
        r = self.ranking
        share = "{:.3f}".format
        table = pd.DataFrame(
            {"method": self._number_methods(), "n": r.n, "accuracy": r.accuracy.map(share)}
        )
        table["95 %"] = r.accuracy_lo.map(share) + "-" + r.accuracy_hi.map(share)
        return lines_of(table)

    def _matrix_lines(self) -> list[str]:
        """Return the matrix, in parts as wide as a line."""
        # the columns have the numbers of their methods
        names = self._number_methods()
        numbers = [str(k) for k in range(1, len(names) + 1)]
        table = self.cells().set_axis(numbers, axis=1)
        for k in range(len(numbers)):
            table.iloc[k, k] = "."
        table.insert(0, "", names)

        # as many of them as a line has room for, then the next
        widths = [max(len(name), *table[name].map(len)) + 2 for name in numbers]
        lines = wrap(self.legend)
        room = LINE_WIDTH - max(map(len, names), default=0)
        while numbers:
            fit = max(int((np.cumsum(widths) <= room).sum()), 1)
            lines += [""] + lines_of(table[[""] + numbers[:fit]])
            numbers = numbers[fit:]
            widths = widths[fit:]
        return lines

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN becomes null."""
        tables = {}
        for name in ("ranking", "pairs"):
            tables[name] = plain(getattr(self, name))
        return {"truth": self.truth, "cases": self.cases, **tables}

    def to_frame(self) -> pd.DataFrame:
        """Return one row per pair, as `pairs`."""
        return self.pairs

    def __repr__(self) -> str:
        """Return one line."""
        differ = int(self.pairs["differ"].sum())
        return f"Comparison of {len(self.ranking)} methods: {differ} of {len(self.pairs)} differ"

    def _repr_html_(self) -> str:
        shown = self.cells().rename_axis("method").reset_index()
        return page_part(f"{self!r}; {self.legend}", shown)


def _format_p(p: float) -> str:
    """Return a p-value as papers print it.

    >>> _format_p(0.0126), _format_p(0.00002), _format_p(1.0)
    ('.013', '<.001', '1')
    """
    if p < 0.001:
        return "<.001"
    if p > 0.9995:
        return "1"
    return f"{p:.3f}".removeprefix("0")


def compare(
    book: RunArrays,
    truth: str = "cycled",
    chosen: Collection[str] = (),
) -> Comparison:
    """Compare the methods of a run with each other, or those that are chosen with every other.

    An answer is right when it is the label; "no decision" is never right. Where a method does not
    apply it is not compared. McNemar (1947), Holm (1979).
    """
    if truth not in TRUTHS:
        raise UserError(f"truth {truth!r} is unknown: {nearest(truth, TRUTHS)}")

    # loops with a label
    side = _Side.of(book, truth, np.flatnonzero(book.truth[truth] >= 0))

    # every two methods, or the chosen with every other
    numbers = range(len(book.methods))
    first = [k for k in numbers if book.methods[k] in chosen]
    couples = list(combinations(numbers, 2))
    if chosen:
        couples = []
        for i in first:
            for j in numbers:
                if j > i or (j < i and j not in first):
                    couples.append((i, j))

    # each pair on the loops that both apply to
    found = []
    for i, j in couples:
        at = side.applies[i] & side.applies[j]
        found.append(Paired.of(side.right[i, at], side.right[j, at]))
    rows = []
    for (i, j), paired in zip(couples, found, strict=True):
        rows.append((book.methods[i], book.methods[j], *paired))
    pairs = pd.DataFrame(rows, columns=list(_PAIR[:-2]))
    pairs["p"] = holm([paired.p for paired in found])
    pairs["differ"] = pairs["p"] < _LEVEL
    return Comparison(truth, side.right.shape[1], _rank_side(book, side), pairs)


class _Side(NamedTuple):
    """What the methods say of the loops with a label: (m, n) whether they are right, and whether
    they apply.
    """

    methods: tuple[str, ...]
    right: np.ndarray
    applies: np.ndarray

    @classmethod
    def of(cls, book: RunArrays, truth: str, at: np.ndarray) -> _Side:
        # what the record does not tell counts as applying
        right = book.verdict[:, at] == book.truth[truth][at]
        return cls(book.methods, right, book.applicable[:, at] != 0)


def plain(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a table's rows as JSON types; NaN becomes null."""
    return frame.astype(object).where(frame.notna(), None).to_dict("records")


def _rank_side(book: RunArrays, side: _Side) -> pd.DataFrame:
    failed = failures(book)
    rows = []
    for method, right, applies in zip(book.methods, side.right, side.applies, strict=True):
        n = int(applies.sum())
        share = rate(int(right[applies].sum()), n)
        rows.append((method, n, *share, failed[method]))
    columns = ["method", "n", "accuracy", "accuracy_lo", "accuracy_hi", "failed"]
    table = pd.DataFrame(rows, columns=columns)
    table["home"] = [home_of(method, book) for method in book.methods]
    return table.sort_values("accuracy", ascending=False, kind="stable", ignore_index=True)


# --- Compare the same loops: which loop of one run is which of another, the one that has its id,
# and what two sets of answers to the same loops win and lose against each other.


class Pairs(NamedTuple):
    """The loops two runs have in common."""

    # now, before: (m,) where each stands in either run
    now: np.ndarray
    before: np.ndarray
    same: np.ndarray  # (m,) whether the two records are the same, bit for bit


def pair(now: RunArrays, before: RunArrays) -> Pairs:
    """Pair the loops of two runs."""
    _, at, was_at = np.intersect1d(now.ids, before.ids, return_indices=True)
    return Pairs(at, was_at, now.hashes[at] == before.hashes[was_at])


class Paired(NamedTuple):
    """Of n loops: where only the first of two answers was right (win), only the second (loss), both
    or neither (tie).
    """

    n: int
    win: int
    tie: int
    loss: int

    @classmethod
    def of(cls, first: np.ndarray, second: np.ndarray) -> Paired:
        """Count two sets of answers, each (n,) right or not."""
        win = int((first & ~second).sum())
        loss = int((~first & second).sum())
        return cls(first.size, win, first.size - win - loss, loss)

    @property
    def p(self) -> float:
        """Exact McNemar p-value of "both are right equally often"."""
        return mcnemar(self.loss, self.win)

    @property
    def p_worse(self) -> float:
        """That of "the second is not right less often", one-sided."""
        return mcnemar(self.win, self.loss, worse=True)
