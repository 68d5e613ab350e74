"""What a check found, for a terminal, for a pull request's summary, and for a test reporter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import pandas as pd

from simbench.bench.score.compare import plain
from simbench.bench.score.quantification import COVERAGE, MEDIAN_ERROR

_SHOWN = 20  # flipped scenarios in a text; JSON has all


@dataclass(frozen=True, eq=False)
class Check:
    """What a run says against its baseline."""

    paired: bool  # whether answers are compared loop by loop
    basis: str  # which test was used and why, in one sentence
    problems: tuple[
        str,
        ...,
        # what fails without any statistics: missing methods or scenarios, new errors, a changed
        # truth
    ]
    # method, label, what ("right": of all, "detection": share of the positives called sticky,
    # "rejection": of the negatives called healthy, "no miss", "no false alarm": the same with no
    # decision allowed, "AUC", "coverage" and "median error" of S and J of a family of valves), n
    # (of them, where the method covers the loop), before, now, lost, won (cases, paired only), p
    # (Holm-corrected), seen (smallest drop found in 8 of 10 such runs), worse
    tests: pd.DataFrame
    # every changed verdict: scenario_id (the baseline's), method, was, now, record ("same" or
    # "other"), sticky, cycled, block, disturbance
    flips: pd.DataFrame
    home: str = "BASELINE"  # folder of the baseline, which holds the loops of the flips
    # methods of which nobody could tell whether they became worse, and why
    unseen: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether anything became worse."""
        return bool(self.problems) or bool(self.tests["worse"].any())

    @property
    def answer(self) -> str:
        """passed, FAILED or "cannot tell"; only the first is good enough."""
        return "FAILED" if self.failed else "cannot tell" if self.unseen else "passed"

    @property
    def reasons(self) -> list[str]:
        """What failed or could not be seen, one sentence each."""
        worse = self.tests[self.tests["worse"]].to_dict("records")
        return [*self.problems, *(sentence(row) for row in worse), *self.unseen]

    def as_text(self) -> str:
        """Return verdict, basis, reasons, what changed, and the scenarios that flipped."""
        lines = [f"check {self.answer}: {self.basis}", *(f"- {r}" for r in self.reasons)]
        moved = _moved(self)
        if len(moved):
            lines += ["", moved.to_string(index=False, float_format="%.3f")]
        if len(self.flips):
            shown = _worst_first(self).head(_SHOWN)
            lines += [
                "",
                f"{len(self.flips)} verdicts changed" + _cut(self),
                shown.to_string(index=False),
            ]
            lines += ["", "simulate one again:", again(self, str(shown["scenario_id"].iloc[0]))]
        return "\n".join(lines)

    def as_markdown(self) -> str:
        """Return the same for a pull request's summary."""
        lines = [f"### Detector check: {self.answer.lower()}", "", self.basis, ""]
        lines += [f"- {r}" for r in self.reasons] + [""] * bool(self.reasons)
        moved = _moved(self)
        lines += _table(moved) if len(moved) else ["No rate moved."]
        if len(self.flips):
            shown = _worst_first(self).head(_SHOWN)
            title = f"{len(self.flips)} verdicts changed{_cut(self)}"
            lines += ["", f"<details><summary>{title}</summary>", "", *_table(shown), ""]
            lines += ["", f"`{again(self, str(shown['scenario_id'].iloc[0]))}`", "", "</details>"]
        return "\n".join(lines) + "\n"

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types."""
        tables = {name: plain(getattr(self, name)) for name in ("tests", "flips")}
        about = {
            "answer": self.answer,
            "failed": self.failed,
            "paired": self.paired,
            "basis": self.basis,
        }
        return {**about, "reasons": self.reasons, **tables}

    def as_junit(self) -> str:
        """Return JUnit XML: one test case per method, and one for the tables themselves."""
        suite = ElementTree.Element("testsuite", name="simbench check")
        cases = [("run", list(self.problems))]
        for method, rows in self.tests.groupby("method", sort=True):
            wrong = [sentence(row) for row in rows[rows["worse"]].to_dict("records")]
            cases.append(
                (
                    str(method),
                    [*wrong, *(said for said in self.unseen if said.startswith(f"{method}:"))],
                )
            )
        for name, wrong in cases:
            case = ElementTree.SubElement(suite, "testcase", classname="simbench.check", name=name)
            if wrong:
                ElementTree.SubElement(case, "failure", message=wrong[0]).text = "\n".join(wrong)
        suite.set("tests", str(len(cases)))
        suite.set("failures", str(sum(bool(wrong) for _, wrong in cases)))
        ElementTree.indent(suite)
        # the declaration by hand: ElementTree would name the machine's locale
        return (
            '<?xml version="1.0"'
            f' encoding="utf-8"?>\n{ElementTree.tostring(suite, encoding="unicode")}\n'
        )


def again(check: Check, scenario_id: str) -> str:
    """Return the command that simulates a flipped scenario again."""
    return f"simbench simulate --from {check.home} --id {scenario_id} -o record.csv"


def sentence(row: dict[str, Any]) -> str:
    """Return what became worse, from a row of the tests."""
    cases = "" if pd.isna(row["lost"]) else f", {row['lost']:.0f} lost and {row['won']:.0f} won"
    moved = (
        f"{'rose' if row['now'] > row['before'] else 'fell'} from {row['before']:.3f} to"
        f" {row['now']:.3f}"
    )
    of = (
        f"of {row['label']}"
        if row["what"] in (COVERAGE, MEDIAN_ERROR)
        else f"against {row['label']!r}"
    )
    return f"{row['method']}: {row['what']} {of} {moved}{cases} (p = {row['p']:.2g})"


def _moved(check: Check) -> pd.DataFrame:
    tests = check.tests
    same = (tests["before"] == tests["now"]) | tests[["before", "now"]].isna().all(axis=1)
    changed = tests[~same]
    return (
        changed.drop(columns=[] if check.paired else ["lost", "won"])
        .sort_values("p", kind="stable")
        .head(2 * _SHOWN)
    )


def _worst_first(check: Check) -> pd.DataFrame:
    bad = set(check.tests.loc[check.tests["worse"], "method"])
    order = check.flips.assign(_order=~check.flips["method"].isin(bad)).sort_values(
        "_order", kind="stable"
    )
    return order.drop(columns="_order")


def _cut(check: Check) -> str:
    return f", the first {_SHOWN}:" if len(check.flips) > _SHOWN else ":"


def _table(frame: pd.DataFrame) -> list[str]:
    def cell(x: Any) -> str:
        return f"{x:.3g}" if isinstance(x, float) else str(x).replace("|", "\\|")

    rows = [[cell(x) for x in row] for row in frame.itertuples(index=False)]
    return [
        "| " + " | ".join(r) + " |" for r in [list(frame.columns), ["---"] * frame.shape[1], *rows]
    ]
