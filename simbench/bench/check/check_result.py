"""What a check found, for a terminal, and for a pull request's summary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from simbench.bench.score.compare import plain
from simbench.bench.score.quantification import COVERAGE, MEDIAN_ERROR
from simbench.page.text import lines_of

NO_LOSS = "same"
WORSE = "worse"
CANNOT_TELL = "cannot tell"
NOT_COMPARABLE = "not comparable"  # what a command says where there is no check
_SHOWN = 20  # flipped scenarios in a summary of a pull request; JSON has all
# in a terminal, so that all of it fits a screen of 40 lines and 100 columns
_SCREEN = {"reasons": 5, "rates": 5, "flips": 10}
_NAME = 24  # characters of a method's name there
_RIGHT = "right"
# what a rate counts: a clause with the share in %, and whether it counts what is not so
_CLAUSES = {
    _RIGHT: ("is right in {:.1f} % of the loops", False),
    "detection": ("detects stiction in {:.1f} % of the {}", False),
    "rejection": ("denies stiction in {:.1f} % of the other loops", False),
    "no miss": ("denies stiction in {:.1f} % of the {}", True),
    "no false alarm": ("reports stiction in {:.1f} % of the other loops", True),
}
# rates that count the same loops
_SIDES = {"no miss": "detection", "no false alarm": "rejection"}
_POSITIVES = {"sticky": "sticky loops", "cycled": "loops with a limit cycle"}


@dataclass(frozen=True, eq=False)
class Check:
    """What a run says against its baseline."""

    basis: str  # which test was used and why, in one sentence
    problems: tuple[
        str,
        ...,
        # what fails without any statistics: missing methods or scenarios, new errors, a changed
        # truth
    ]
    # method, truth, population, what ("right": of all, "detection": share of the positives called
    # sticky, "rejection": of the negatives called healthy, "no miss", "no false alarm": the same
    # with no decision allowed, "AUC", "coverage" and "median error" of S and J of a family of
    # valves), n (of them, where the method covers the loop), before, now, lost, won (cases), p
    # (Holm-corrected), seen (smallest drop found in 8 of 10 such runs), worse
    tests: pd.DataFrame
    # every changed verdict: scenario_id, method, was, now, bits (of the record, "equal" or
    # "other"), sticky, cycled, block, disturbance
    flips: pd.DataFrame
    # loops whose records have equal bits, other bits and the same verdicts, and another verdict
    bits: dict[str, int]
    home: str = "BASELINE"  # folder of the baseline, which holds the loops of the flips
    # methods of which nobody could tell whether they became worse, and why
    unseen: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return one line."""
        return f"Check against {self.home}: {self.result}"

    @property
    def failed(self) -> bool:
        """Whether anything became worse."""
        return bool(self.problems) or bool(self.tests["worse"].any())

    @property
    def result(self) -> str:
        """One of "same", "worse" and "cannot tell", as too few loops are covered; only the first is
        good enough.
        """
        if self.failed:
            return WORSE
        if self.unseen:
            return CANNOT_TELL
        return NO_LOSS

    @property
    def reasons(self) -> list[str]:
        """What failed or could not be seen, one sentence each."""
        worse = self.tests[self.tests["worse"]].to_dict("records")
        return list(self.problems) + [sentence(row) for row in worse] + list(self.unseen)

    def as_text(self) -> str:
        """Return what fell, by how much, then the rule, the rates that moved and the scenarios that
        flipped: what fits a screen.
        """
        found = (
            list(map(headline, _worse_methods(self.tests)))
            + list(self.problems)
            + list(self.unseen)
        )

        # The result, with the first reason, then a few more
        head = f"{self.result}: {found[0] if found else 'no detector became worse'}."
        shown = found[1 : _SCREEN["reasons"]]
        more = len(found) - 1 - len(shown)
        lines = [head] + [f"- {reason}" for reason in shown]
        if more > 0:
            lines += [f"- and {more} more, which --json lists"]

        # How many bits are equal, and what was compared
        told = (
            f"{self.bits['equal']} loops have equal bits, {self.bits['other_bits']} other bits and"
            f" the same verdicts, {self.bits['other_verdict']} another verdict"
        )
        return "\n".join(lines + [f"Compared: {self.basis}.", f"{told}."] + self.changes())

    def changes(self) -> list[str]:
        """Return the rates that moved and the scenarios that flipped, the worst first."""
        # rates that moved
        lines = []
        moved = _table_of_moves(self).drop(columns="seen")
        if len(moved):
            lines += [""] + _short_lines(moved.head(_SCREEN["rates"]))

        # scenarios that flipped
        if len(self.flips):
            most = _SCREEN["flips"]
            flips = _worst_first(self)
            names = ["scenario_id", "method", "was", "now", "cycled", "disturbance"]
            kept = [name for name in names if name in flips]
            lines += ["", f"{_count_verdicts(flips)} changed{_describe_cut(self, most)}"]
            lines += _short_lines(flips[kept].head(most))
            first = str(flips["scenario_id"].iloc[0])
            lines += ["", "To simulate one of them again:", command_again(self, first)]
        return lines

    def as_markdown(self) -> str:
        """Return the same for a pull request's summary."""
        lines = [f"### Detector check: {self.result}", "", self.basis, ""]
        lines += [f"- {r}" for r in self.reasons] + [""] * bool(self.reasons)
        moved = _table_of_moves(self)
        lines.append(_to_markdown(moved) if len(moved) else "No rate moved.")
        if len(self.flips):
            shown = _worst_first(self).head(_SHOWN)
            title = f"{_count_verdicts(self.flips)} changed{_describe_cut(self, _SHOWN)}"
            lines += ["", f"<details><summary>{title}</summary>", "", _to_markdown(shown), "", ""]
            again = command_again(self, str(shown["scenario_id"].iloc[0]))
            lines += [f"`{again}`", "", "</details>"]
        return "\n".join(lines) + "\n"

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types."""
        tables = {}
        for name in ("tests", "flips"):
            tables[name] = plain(getattr(self, name))
        about = {
            "result": self.result,
            "bits": self.bits,
            "basis": self.basis,
        }
        return {**about, "reasons": self.reasons, **tables}


def command_again(check: Check, scenario_id: str) -> str:
    """Return the command that simulates a flipped scenario again."""
    return f"simbench simulate --from {check.home} --id {scenario_id} -o record.csv"


def sentence(row: dict[str, Any]) -> str:
    """Return what became worse, from a row of the tests."""
    # How many loops changed, and by how much the rate moved
    if pd.isna(row["lost"]):
        cases = ""
    else:
        cases = f", {row['lost']:.0f} lost and {row['won']:.0f} won"
    moved = (
        f"{'rose' if row['now'] > row['before'] else 'fell'} from {row['before']:.3f} to"
        f" {row['now']:.3f}"
    )
    if row["what"] in (COVERAGE, MEDIAN_ERROR):
        of = f"of {row['truth']}"
    else:
        of = f"against {row['truth']!r}"
    return f"{row['method']}: {row['what']} {of} {moved}{cases} (p = {row['p']:.2g})"


def _table_of_moves(check: Check) -> pd.DataFrame:
    tests = check.tests
    same = (tests["before"] == tests["now"]) | tests[["before", "now"]].isna().all(axis=1)
    changed = tests[~same]

    # the rows that the first sentences speak of come first
    told = {(row["method"], row["truth"], row["what"]) for row in _worse_methods(tests)}
    keys = zip(changed["method"], changed["truth"], changed["what"], strict=True)
    order = changed.assign(_later=[key not in told for key in keys])

    # what is true of a loop by one truth mostly is by the other, and a detection lost is often a
    # miss: of such twins the plainer one is shown, the one of the truth 'cycled' where both are
    order["_side"] = [_SIDES.get(what, what) for what in order["what"]]
    order = order.sort_values(["_later", "p", "truth"], kind="stable")
    order = order.drop_duplicates(["method", "_side"])
    return order.drop(columns=["_later", "_side"]).head(2 * _SHOWN)


def _worst_first(check: Check) -> pd.DataFrame:
    bad = set(check.tests.loc[check.tests["worse"], "method"])
    order = check.flips.assign(_order=~check.flips["method"].isin(bad)).sort_values(
        "_order", kind="stable"
    )
    return order.drop(columns="_order")


def _count_verdicts(flips: pd.DataFrame) -> str:
    return f"{len(flips)} verdict{'s' * (len(flips) != 1)}"


def _describe_cut(check: Check, most: int) -> str:
    if len(check.flips) > most:
        return f", the first {most}:"
    return ":"


def _worse_methods(tests: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield a row for each method that became worse, of all its answers where these show it."""
    for _, rows in tests[tests["worse"]].groupby("method", sort=False):
        first, *_ = sorted(
            rows.to_dict("records"), key=lambda row: (row["what"] != _RIGHT, row["truth"])
        )
        yield first


def headline(row: dict[str, Any]) -> str:
    """Return in words what became worse, from a row of the tests.

    >>> row = {"method": "he", "truth": "cycled", "population": "all", "what": "right"}
    >>> row = {**row, "lost": 66, "won": 0}
    >>> what, _, cases = headline({**row, "before": 0.535, "now": 0.504}).partition(": ")
    >>> what
    'he is right in 50.4 % of the loops, before 53.5 %'
    >>> cases
    '66 answers lost, 0 won (truth cycled, population all)'
    """
    if row["what"] not in _CLAUSES:
        return sentence(row)
    clause, counts_others = _CLAUSES[row["what"]]
    now = 100.0 * (1.0 - row["now"] if counts_others else row["now"])
    before = 100.0 * (1.0 - row["before"] if counts_others else row["before"])
    if pd.isna(row["lost"]):
        cases = ""
    else:
        cases = f": {row['lost']:.0f} answers lost, {row['won']:.0f} won"
    clause = clause.format(now, _POSITIVES.get(row["truth"], row["truth"]))
    row_of = f"truth {row['truth']}, population {row['population']}"
    return f"{row['method']} {clause}, before {before:.1f} %{cases} ({row_of})"


def _format_numbers(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table with its numbers as texts."""
    return frame.map(lambda x: f"{x:.3g}" if isinstance(x, float) else str(x))


def _short_lines(frame: pd.DataFrame) -> list[str]:
    """Return a table in lines that fit a terminal."""
    return lines_of(_format_numbers(frame).map(lambda text: text[:_NAME]))


def _to_markdown(frame: pd.DataFrame) -> str:
    """Return a table as Markdown; a bar in a name ends no cell."""
    escaped = _format_numbers(frame).map(lambda text: text.replace("|", "\\|"))
    return escaped.to_markdown(index=False, disable_numparse=True)
