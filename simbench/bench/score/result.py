"""Scores of a run, for a terminal and for a program: the same rows in a fixed order, with what the
run can resolve.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.bench.score import picture
from simbench.bench.score.answers import (
    RATES,
    answers_of,
    axis_codes,
    counted,
    long_table,
    tallied,
    with_names,
)
from simbench.bench.score.compare import Comparison, compare
from simbench.bench.score.names import (
    ALL,
    OF_OSCILLATING,
    ROLE_YARDSTICK,
    SAMPLED,
    group_of,
    kind_of,
)
from simbench.bench.score.ranks import UNDECIDED, Ranks
from simbench.bench.score.table import full_text, headline
from simbench.bench.store.folder import write_file
from simbench.bench.store.manifest import unmatched
from simbench.bench.store.reading import COPIES, TRUTHS, RunArrays
from simbench.detectors.errors import ParameterError, UserError, nearest
from simbench.detectors.views import page_part
from simbench.files import csv_text

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

_MOST = 2  # axes of a table that can be read
_SHOWN = [
    f"{name}{end}"
    for name in ("accuracy", "sensitivity", "false_positives", "no_decision")
    for end in ("", "_lo", "_hi")
]
_PLACE = ("method", "truth", "process", "population")
_ROWS = (
    _PLACE
    + ("n", "applicable")
    + RATES
    + (
        "auc",
        "accuracy_lo",
        "accuracy_hi",
        "sees_mv",
        "rank",
        "sensitivity_at_5",
        "cost",
        "home",
        "division",
        "name",
        "answered",
    )
)
_RANKING = (
    "rank",
    "method",
    "n",
    "cost",
    "cost_lo",
    "cost_hi",
    "accuracy",
    "sensitivity",
    "false_positives",
    "no_decision",
)
_INTERVALS = _PLACE + (
    "cost_lo",
    "cost_hi",
    "no_decision_lo",
    "no_decision_hi",
    "sensitivity_at_5_lo",
    "sensitivity_at_5_hi",
    "positives",
    "cost_over_no_waveform",
    "cost_over_no_waveform_lo",
    "cost_over_no_waveform_hi",
)


@dataclass(frozen=True, eq=False)
class Scores:
    """What a run says about its detectors.

    Parameters
    ----------
    table : DataFrame
        One row per method, truth, process ("all", "self-regulating", "integrating") and population
        ("all", "oscillating", "not oscillating", by the common oscillation detection; loops of
        blocks that are not ranked are in "all" alone): n scenarios with a truth, positives;
        applicable: on how many the method's source covers the loop; over those, with Wilson
        intervals (NAME_lo, NAME_hi), accuracy (no decision is wrong), accuracy_decided,
        no_decision, sensitivity (of positives, no decision counts as missed), false_positives (of
        negatives), auc over records with a score, with DeLong's interval; cost (an error 1, no
        decision `undecided`) and rank by it among its kind (none where it answers less than 90 % of
        the loops, failed too often, or fewer than 30 loops have a label; one of the user's own
        (own) that answers fewer is ranked on these, rank_loops of them); sensitivity_at_5 (at 5 %
        false positives, threshold from other groups); cost_over_no_waveform, the cost less that of
        the reference row `no_waveform` on the same loops; accuracy_all over everything; home, where
        its constants were fitted; division ("published", "tuned" here, "learned", "reference", None
        where not stated), name with every changed threshold; answered, by the "package" or from a
        "file"; missed, no_decision_positives and no_decision_negatives (no decision of
        positives and of negatives); errors; median runtime in ms.
    by_axis : DataFrame
        The same against `cycled` by axis and value, without AUC's interval and rank.
    disagreement : DataFrame
        How often sticky, predicted and cycled say what together.
    left_out : DataFrame
        method, of ("entrained", "unclear", "does not apply"), n, and the shares of the three
        answers with intervals.
    by_cause : DataFrame
        Of loops that the valve does not make cycle: method, cause (the kind of the echo, "own
        tuning", "no oscillation", "other"), n, false_positives with their 95 % interval (_lo, _hi),
        and no_decision.
    quantification : DataFrame
        method, family of valves, parameter (S or J), n sticky loops for which the method gave it,
        median_error (from the middle of an interval) and width in shares of the valve's S, coverage
        of intervals that are said to hold nine in ten.
    standing : dict of (truth, process, population) to Ranks
        What the run can resolve, among methods that see OP and PV only.
    manifest : dict
        Of the run.
    counts : dict
        How many scenarios the run has, how many of them oscillate and, of a run of more than
        20 000, how many were drawn at random (whole groups) for what needs an order or a scatter:
        AUC, sensitivity_at_5, cost_over_no_waveform, median_ms, the rows
        `no_waveform` and `rhythm`, and the width of the cost's interval. Every other number
        counts all.
    failing : dict of method to int
        Methods without a rank because they failed on more records than allowed, and on how many.
    undecided : float
        Cost of no decision.
    book : RunArrays
        The answers that were scored.
    chosen : tuple of str
        The methods that are shown, and compared with every other; all where it is empty.
    """

    table: pd.DataFrame
    by_axis: pd.DataFrame
    disagreement: pd.DataFrame
    left_out: pd.DataFrame
    by_cause: pd.DataFrame
    quantification: pd.DataFrame
    standing: dict[tuple[str, str, str], Ranks]
    manifest: dict[str, Any]
    counts: dict[str, int] = field(default_factory=dict)
    failing: dict[str, int] = field(default_factory=dict)
    undecided: float = UNDECIDED
    book: RunArrays | None = field(default=None, repr=False)
    chosen: tuple[str, ...] = ()

    def of(self, methods: Sequence[str]) -> Scores:
        """Return the rows of some methods alone, with the ranks that they have among all.

        Parameters
        ----------
        methods : sequence of str
            Ids of methods of the run, or of reference rows.

        Returns
        -------
        Scores
            `compare` of them compares each with every method of the run, and corrects p for these
            pairs; `along` shows them alone.

        Raises
        ------
        UserError
            For a method that the run does not have.
        """
        known = list(dict.fromkeys(self.table["method"]))
        for name in methods:
            if name not in known:
                raise UserError(f"no method {name!r} in this run: {nearest(name, known)}")
        tables = ("by_axis", "left_out", "by_cause", "quantification")
        kept = {
            name: t[t["method"].isin(methods)] for name in tables if len(t := getattr(self, name))
        }
        return replace(self, chosen=tuple(methods), **kept)

    @property
    def resolution(self) -> float:
        """Smallest difference of cost against `cycled` that the run resolves on oscillating
        loops.
        """
        return self.standing["cycled", ALL, OF_OSCILLATING].resolution

    def rows(
        self,
        truth: str = "cycled",
        process: str = ALL,
        population: str = OF_OSCILLATING,
    ) -> pd.DataFrame:
        """Return the rows of one block with every column of `table`, best first: methods that see
        OP and PV, those that see MV, reference rows, other tests; `group` names what they are
        ranked with, `shared` tells whether others have the same rank.
        """
        # the rows of one block
        t = self.table
        here = (t.truth == truth) & (t.process == process)
        rows = t[here & (t.population == population)]

        # what orders them: kind, coverage, failures, then cost
        kind = [kind_of(role, mv) for role, mv in zip(rows.role, rows.sees_mv)]
        part = [k < 2 and on < n for k, on, n in zip(kind, rows.rank_loops, rows.n)]
        answered = [-int(n) if p else 0 for n, p in zip(rows.applicable, part)]
        failed = [p and method in self.failing for p, method in zip(part, rows.method)]
        keys = {"kind": kind, "partial": part, "_unranked": rows["rank"].isna(), "_few": answered}
        order = ["kind", "partial", "_failed", "_unranked", "_few", "cost"]
        rows = rows.assign(**keys, _failed=failed).sort_values(order, kind="stable")
        rows = rows.drop(columns=["_failed", "_unranked", "_few"])

        # which are ranked with each other
        rows = rows.assign(group=[group_of(row, self.failing) for row in rows.itertuples()])
        alike = rows.duplicated(["kind", "group", "rank"], keep=False)
        return self._of_chosen(rows.assign(shared=rows["rank"].notna() & alike))

    def _of_chosen(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Return the rows of the methods that are chosen."""
        if self.chosen and len(rows):
            return rows.loc[rows["method"].isin(self.chosen)]
        return rows

    def ranking(
        self,
        truth: str = "cycled",
        process: str = ALL,
        population: str = OF_OSCILLATING,
    ) -> pd.DataFrame:
        """Return the ranking on one kind of loops.

        Parameters
        ----------
        truth : str
            The label answers are compared with: cycled, predicted or sticky.
        process : str
            all, self-regulating or integrating.
        population : str
            oscillating, not oscillating or all.

        Returns
        -------
        DataFrame
            rank (NaN for what is not ranked), method, n (loops with a label to which it applies),
            cost with its 95 % interval (cost_lo, cost_hi), accuracy, sensitivity, false_positives,
            no_decision; best first: methods that see OP and PV, those that see MV, reference rows,
            other tests. `table` has every column.
        """
        rows = self.rows(truth, process, population)
        if len(rows):
            rows = rows.assign(n=rows.applicable)
        else:
            rows = rows.reindex(columns=_RANKING)
        return rows.loc[:, list(_RANKING)].reset_index(drop=True)

    def as_text(self, truth: str = "cycled", full: bool = False, where: str = "") -> str:
        """Return the score table for a terminal.

        Parameters
        ----------
        truth : str
            The label answers are compared with: cycled, predicted or sticky.
        full : bool
            All tables instead of the ranking on oscillating loops alone.
        where : str
            The last sentence: where the report is, or how to make it.

        Returns
        -------
        str
            The ranking with its intervals, then what could not be ranked.
        """
        return "\n".join(full_text(self, truth, where) if full else headline(self, truth, where))

    def as_json(self) -> dict[str, Any]:
        """Return rows, resolution and what stands beside them as JSON types; NaN and infinity
        become null.
        """
        table = self._of_chosen(self.table)
        resolution = self.resolution
        return {
            "grid": self.manifest["grid"],
            "grid_hash": self.manifest["grid_hash"],
            "unmatched": unmatched(self.manifest),
            "copies": self.manifest.get(COPIES, 0),
            "benchmark": self.manifest.get("benchmark"),
            "undecided": self.undecided,
            **{key: n for key, n in self.counts.items() if key == SAMPLED},
            "rows": _as_records(table[list(_ROWS)] if len(table) else table),
            "intervals": _as_records(table[list(_INTERVALS)] if len(table) else table),
            "resolution": None if math.isnan(resolution) else resolution,
            "by_axis": _as_records(self.by_axis),
            "disagreement": _as_records(self.disagreement),
            "left_out": _as_records(self.left_out),
            "by_cause": _as_records(self.by_cause),
            "quantification": _as_records(self.quantification),
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the ranking against `cycled` on oscillating loops.

        Returns
        -------
        DataFrame
            One row per method, best first, as `ranking`.
        """
        return self.ranking()

    def along(self, axis: str | Sequence[str], truth: str = "cycled") -> pd.DataFrame:
        """Return how each method's answers depend on one axis of the grid, or on two together.

        Parameters
        ----------
        axis : str or sequence of str
            Td_over_T, Td_over_Ti, S_over_2J, noise_ratio, disturbance, tuning, samples_per_period,
            or an axis of the grid's own, such as valve.S; one, or two.
        truth : str
            The label answers are compared with.

        Returns
        -------
        DataFrame
            method, the axes, n loops with a label to which the method applies, how many of them are
            positives, accuracy, sensitivity, false_positives and no_decision with their 95 %
            intervals (_lo, _hi); values in order.

        Raises
        ------
        ParameterError
            For what is no axis of this run, or more than two.
        """
        return self._of_chosen(_rates_along(self._stored_answers(), axis, truth))

    def compare(self, truth: str = "cycled") -> Comparison:
        """Compare every two methods, scenario by scenario.

        Parameters
        ----------
        truth : str
            The label answers are compared with.

        Returns
        -------
        Comparison
            `pairs` has wins, ties, losses and p of every pair; `matrix("p")` is one of them as a
            square table.

        Raises
        ------
        UserError
            For an unknown truth.
        """
        return compare(self._stored_answers(), truth, self.chosen)

    def _stored_answers(self) -> RunArrays:
        """Return the answers, without which scores are tables alone."""
        if self.book is None:
            raise UserError("these scores hold no answers; score the folder of a run")
        return self.book

    def plot(self, **options: Any) -> Any:
        """Draw each method's cost on oscillating loops, with its interval.

        Parameters
        ----------
        **options
            As `pandas.DataFrame.plot` takes them, such as figsize.

        Returns
        -------
        matplotlib.axes.Axes
            Bars of cost (0 to 1), the lowest on top.
        """
        return picture.bars(self.ranking(), **options)

    def __repr__(self) -> str:
        """Return one line."""
        ranked = int(self.ranking()["rank"].notna().sum())
        scenarios = self.counts.get("scenarios", 0)
        return f"Scores of grid {self.manifest['grid']}: {ranked} ranked methods, {scenarios} loops"

    def _repr_html_(self) -> str:
        said = f"oscillating loops; costs {self.resolution:.3f} apart give any two another rank"
        return page_part(said, self.ranking())

    def write(self, folder: Path) -> None:
        """Write scores.csv and scores_by_axis.csv."""
        for name, frame in (("scores", self.table), ("scores_by_axis", self.by_axis)):
            write_file(folder / f"{name}.csv", csv_text(frame, float_format="%.5g").encode())


def _as_records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    return json.loads(frame.to_json(orient="records", double_precision=6))


def _rates_along(book: RunArrays, axis: str | Sequence[str], truth: str = "cycled") -> pd.DataFrame:
    """Return rates by method and value of one axis or two."""
    # one axis or two of the run
    if isinstance(axis, str):
        axes = [axis]
    else:
        axes = list(axis)
    for name in axes:
        if name not in book.along:
            raise ParameterError(f"no axis {name!r} in this run: {nearest(name, book.along)}")
    if not 0 < len(set(axes)) == len(axes) <= _MOST:
        raise ParameterError(f"axes {', '.join(axes) or '(none)'}: one axis or two different ones")
    if truth not in TRUTHS:
        raise ParameterError(f"truth {truth!r}: {nearest(truth, TRUTHS)}")

    # rates of every method in every cell
    values, codes = zip(*(axis_codes(book, name) for name in axes), strict=True)
    everyone = [a for a in answers_of(book) if a.role != ROLE_YARDSTICK]
    label = book.truth[truth]
    counts = counted(long_table(everyone), label=label, **dict(zip(axes, codes, strict=True)))
    table = tallied(counts, axes + ["method"])[["n", "applicable", "sticky"] + _SHOWN]
    table = table[table["n"] > 0].drop(columns="n").reset_index()
    table = table.rename(columns={"applicable": "n", "sticky": "positives"})

    # cells by their values; one more than there are: of loops that have none
    texts = [np.array([*of, None], dtype=object) for of in values]
    for name, text in zip(axes, texts, strict=True):
        table[name] = text[table[name]]
    table = table[table[axes].notna().all(axis=1)]
    table = with_names(table, everyone)
    return table.loc[:, ["method"] + axes + ["n", "positives"] + _SHOWN].reset_index(drop=True)
