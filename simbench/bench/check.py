"""Gate: has a detector become worse? A run against a baseline, case by case where the simulated records are the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from detectors.errors import UserError
from detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.bench.baseline import read_book, write_baseline
from simbench.bench.compare import plain
from simbench.bench.statistics import auc, auc_drop, auc_drop_unpaired, holm, mcnemar, rate_drop
from simbench.bench.store import CODES, Book, RunError

LEVEL = 0.05
MARGIN = 0.02
LABELS = ("sticky", "cycled")
SHOWN = 20  # flipped scenarios in a text; JSON has all
# what is counted: among positives or negatives, which answers are good; "no decision" is neither right nor wrong
COUNTED = {
    "detection": (True, (STICTION,)),
    "rejection": (False, (NO_STICTION,)),
    "no miss": (True, (STICTION, NO_DECISION)),
    "no false alarm": (False, (NO_STICTION, NO_DECISION)),
}


@dataclass(frozen=True, eq=False)
class Check:
    """What a run says against its baseline.

    Parameters
    ----------
    paired : bool
        Whether the simulated records are the same, so that answers are compared case by case.
    basis : str
        Which test was used and why, in one sentence.
    problems : tuple of str
        What fails without any statistics: missing methods or scenarios, new errors, a changed truth.
    tests : DataFrame
        method, label, what ("detection": share of the positives called sticky, "rejection": of the negatives called healthy,
        "no miss", "no false alarm": the same with no decision allowed, "AUC"), before, now, lost, won (cases, paired only),
        p (Holm-corrected), worse.
    flips : DataFrame
        Every changed verdict on the same scenario: scenario_id, method, was, now, sticky, cycled, block, disturbance.
    """

    paired: bool
    basis: str
    problems: tuple[str, ...]
    tests: pd.DataFrame
    flips: pd.DataFrame

    @property
    def failed(self) -> bool:
        """Whether anything became worse."""
        return bool(self.problems) or bool(self.tests["worse"].any())

    @property
    def reasons(self) -> list[str]:
        """What failed, one sentence each."""
        return [*self.problems, *(_sentence(row) for row in self.tests[self.tests["worse"]].to_dict("records"))]

    def as_text(self) -> str:
        """Return verdict, basis, reasons, what changed, and the scenarios that flipped."""
        lines = [f"check {'FAILED' if self.failed else 'passed'}: {self.basis}", *(f"- {r}" for r in self.reasons)]
        moved = self._moved()
        if len(moved):
            lines += ["", moved.to_string(index=False, float_format="%.3f")]
        if len(self.flips):
            lines += ["", f"{len(self.flips)} verdicts changed" + self._cut()]
            lines.append(self._worst_first().head(SHOWN).to_string(index=False))
        return "\n".join(lines)

    def as_markdown(self) -> str:
        """Return the same for a pull request's summary."""
        lines = [f"### Detector check: {'failed' if self.failed else 'passed'}", "", self.basis, ""]
        lines += [f"- {r}" for r in self.reasons] + [""] * bool(self.reasons)
        moved = self._moved()
        lines += _table(moved) if len(moved) else ["No rate moved."]
        if len(self.flips):
            title = f"{len(self.flips)} verdicts changed{self._cut()}"
            lines += [
                "",
                f"<details><summary>{title}</summary>",
                "",
                *_table(self._worst_first().head(SHOWN)),
                "",
                "</details>",
            ]
        return "\n".join(lines) + "\n"

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types."""
        tables = {name: plain(getattr(self, name)) for name in ("tests", "flips")}
        return {"failed": self.failed, "paired": self.paired, "basis": self.basis, "reasons": self.reasons, **tables}

    def as_junit(self) -> str:
        """Return JUnit XML: one test case per method, and one for the tables themselves."""
        suite = ElementTree.Element("testsuite", name="simbench check")
        cases = [("run", list(self.problems))]
        for method, rows in self.tests.groupby("method", sort=True):
            cases.append((str(method), [_sentence(row) for row in rows[rows["worse"]].to_dict("records")]))
        for name, wrong in cases:
            case = ElementTree.SubElement(suite, "testcase", classname="simbench.check", name=name)
            if wrong:
                ElementTree.SubElement(case, "failure", message=wrong[0]).text = "\n".join(wrong)
        suite.set("tests", str(len(cases)))
        suite.set("failures", str(sum(bool(wrong) for _, wrong in cases)))
        ElementTree.indent(suite)
        # the declaration by hand: ElementTree would name the machine's locale
        return f'<?xml version="1.0" encoding="utf-8"?>\n{ElementTree.tostring(suite, encoding="unicode")}\n'

    def _moved(self) -> pd.DataFrame:
        same = (self.tests["before"] == self.tests["now"]) | self.tests[["before", "now"]].isna().all(axis=1)
        changed = self.tests[~same]
        return changed.drop(columns=[] if self.paired else ["lost", "won"]).sort_values("p", kind="stable").head(2 * SHOWN)

    def _worst_first(self) -> pd.DataFrame:
        bad = set(self.tests.loc[self.tests["worse"], "method"])
        return (
            self.flips.assign(_order=~self.flips["method"].isin(bad))
            .sort_values("_order", kind="stable")
            .drop(columns="_order")
        )

    def _cut(self) -> str:
        return f", the first {SHOWN}:" if len(self.flips) > SHOWN else ":"


def check_run(folder: str | Path, against: str | Path) -> Check:
    """Compare a run with a baseline.

    Parameters
    ----------
    folder : str or Path
        Folder of a finished run.
    against : str or Path
        Baseline written by `update_baseline`, or another run.

    Returns
    -------
    Check

    Raises
    ------
    RunError
        When a folder is no finished run, was written in another format, or the two are of different grids.

    Notes
    -----
    Rates are compared within the positives and within the negatives of each label, since a moved threshold trades one for
    the other: a gate on accuracy alone would see little of it. Same records: exact one-sided McNemar tests and DeLong's
    test of the AUC. Other records: one-sided two-sample tests of a drop beyond 2 points. All are Holm-corrected to a
    chance of 5 % that unchanged detectors fail.
    """
    return compare_books(read_book(folder), read_book(against))


def compare_books(now: Book, before: Book) -> Check:
    """Compare a run with a baseline, both as arrays; returns and errors as `check_run`."""
    grids = [b.manifest.get("grid") for b in (now, before)]
    if grids[0] != grids[1]:
        raise RunError(f"the run is of grid {grids[0]!r}, the baseline of {grids[1]!r}; run the baseline's grid")
    _, at, was_at = np.intersect1d(now.ids, before.ids, return_indices=True)
    differ = int((now.hashes[at] != before.hashes[was_at]).sum())
    missing = before.ids.size - at.size
    paired = at.size > 0 and differ == 0
    problems = [f"method {m} is in the baseline, not in the run" for m in before.methods if m not in now.methods]
    if missing and (paired or now.manifest.get("grid_hash") == before.manifest.get("grid_hash")):
        problems.append(f"{missing} of the baseline's {before.ids.size} scenarios are not in the run")
    if paired:
        basis = f"the {at.size} records are the baseline's, bit for bit; exact paired tests, Holm-corrected"
        for label in LABELS:
            changed = int((now.truth[label][at] != before.truth[label][was_at]).sum())
            if changed:
                problems.append(f"the truth {label!r} of {changed} scenarios with the same records has changed")
    else:
        other = f"{differ} of {at.size} common records differ" if at.size else "no scenario in common"
        basis = (
            f"other records than the baseline's ({other}); two-sample tests of {now.ids.size} against {before.ids.size} "
            f"scenarios, a drop of {100 * MARGIN:g} points is allowed, Holm-corrected"
        )
    rows: list[dict[str, Any]] = []
    flips: list[pd.DataFrame] = []
    for method in (m for m in before.methods if m in now.methods):
        i, j = now.methods.index(method), before.methods.index(method)
        raised = int((now.failed[i][at] & ~before.failed[j][was_at]).sum()) if at.size else int(now.failed[i].sum())
        if raised and (at.size or not before.failed[j].any()):
            problems.append(f"method {method} raised an error on {raised} scenarios where it had none")
        for label in LABELS:
            one, two = _answers(before, j, label, was_at if paired else None), _answers(now, i, label, at if paired else None)
            rows += [{"method": method, "label": label, **row} for row in _tests(one, two, paired)]
        flips.append(_flips(now, i, at, before.verdict[j][was_at]))
    tests = pd.DataFrame(rows, columns=["method", "label", "what", "before", "now", "lost", "won", "p"])
    tests["p"] = holm(tests["p"])
    tests["worse"] = tests["p"] < LEVEL
    return Check(paired, basis, tuple(problems), tests, pd.concat(flips, ignore_index=True) if flips else pd.DataFrame())


def update_baseline(folder: str | Path, baseline: str | Path) -> str:
    """Make a run the baseline, and say what that changes.

    Parameters
    ----------
    folder : str or Path
        Folder of a finished run.
    baseline : str or Path
        Folder of the baseline; made when absent.

    Returns
    -------
    str
        The difference: methods that come and go, every rate that moved, the first changed verdicts.

    Raises
    ------
    UserError
        When the run cannot be read or the baseline not written.
    """
    now, there = read_book(folder), (Path(baseline) / "manifest.json").exists()
    lines = [f"baseline {baseline}: {now.ids.size} scenarios of grid {now.manifest['grid']} x {len(now.methods)} methods"]
    if there:
        try:
            before = read_book(baseline)
            lines += [f"+ method {m}" for m in now.methods if m not in before.methods]
            changes = compare_books(now, before).as_text().splitlines()[1:]
            lines += changes or ["nothing moved"]
        except UserError as error:  # an unreadable baseline is replaced, and that is said
            lines.append(f"not compared with the old one: {error}")
    write_baseline(folder, baseline)
    return "\n".join(lines)


def _answers(book: Book, method: int, label: str, at: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    # a baseline keeps 24 bits of a score
    truth, verdict, score = book.truth[label], book.verdict[method], book.score[method].astype(np.float32)
    if at is not None:
        truth, verdict, score = truth[at], verdict[at], score[at]
    known = truth >= 0
    return truth[known] == 1, verdict[known], score[known]


def _tests(before: tuple, now: tuple, paired: bool) -> Iterator[dict[str, Any]]:
    (truth_a, said_a, score_a), (truth_b, said_b, score_b) = before, now
    # a truth that changed is reported on its own
    paired = paired and truth_a.shape == truth_b.shape and bool((truth_a == truth_b).all())
    for what, (positive, good) in COUNTED.items():
        codes = [CODES[word] for word in good]
        a, b = np.isin(said_a[truth_a == positive], codes), np.isin(said_b[truth_b == positive], codes)
        row: dict[str, Any] = {"what": what, "before": _share(a), "now": _share(b)}
        if paired:
            row.update(lost=int((a & ~b).sum()), won=int((~a & b).sum()))
            yield {**row, "p": mcnemar(row["lost"], row["won"], worse=True)}
        else:
            yield {**row, "p": rate_drop(int(a.sum()), a.size, int(b.sum()), b.size, MARGIN)}
    p = auc_drop(score_a, score_b, truth_a) if paired else auc_drop_unpaired(score_a, truth_a, score_b, truth_b, MARGIN)
    yield {"what": "AUC", "before": auc(score_a, truth_a).value, "now": auc(score_b, truth_b).value, "p": p}


def _share(right: np.ndarray) -> float:
    return float(right.mean()) if right.size else float("nan")


def _flips(now: Book, method: int, at: np.ndarray, was: np.ndarray) -> pd.DataFrame:
    changed = now.verdict[method][at] != was
    where = at[changed]
    names = np.array([w for w, _ in sorted(CODES.items(), key=lambda item: item[1])])
    return pd.DataFrame(
        {
            "scenario_id": now.ids[where].astype(str),
            "method": now.methods[method],
            "was": names[was[changed]],
            "now": names[now.verdict[method][where]],
            "sticky": now.truth["sticky"][where] == 1,
            "cycled": now.truth["cycled_word"][where],
            **{name: now.axes[name][where] for name in ("block", "disturbance")},
        }
    )


def _sentence(row: dict[str, Any]) -> str:
    cases = "" if pd.isna(row["lost"]) else f", {row['lost']:.0f} lost and {row['won']:.0f} won"
    moved = f"fell from {row['before']:.3f} to {row['now']:.3f}"
    return f"{row['method']}: {row['what']} against {row['label']!r} {moved}{cases} (p = {row['p']:.2g})"


def _table(frame: pd.DataFrame) -> list[str]:
    def cell(x: Any) -> str:
        return f"{x:.3g}" if isinstance(x, float) else str(x).replace("|", "\\|")

    rows = [[cell(x) for x in row] for row in frame.itertuples(index=False)]
    return ["| " + " | ".join(r) + " |" for r in [list(frame.columns), ["---"] * frame.shape[1], *rows]]
