"""Gate: has a detector become worse? A run against a baseline, loop by loop where both stand in the
same place of a grid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from simbench.bench.score.baseline import read_book, write_baseline
from simbench.bench.score.check_result import Check, sentence
from simbench.bench.score.pairing import Pairs, pair
from simbench.bench.score.quantification import COVERAGE, MEDIAN_ERROR, compared
from simbench.bench.statistics import auc, auc_drop, auc_drop_unpaired, holm, mcnemar, rate_drop
from simbench.bench.store.benchmark import refuse_other_benchmark
from simbench.bench.store.checksums import NoRun
from simbench.bench.store.reading import CODES, RunArrays, RunError
from simbench.detectors.errors import UserError
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION

_LEVEL = 0.05
MARGIN = 0.01  # of a rate, paired: what falls by less is no regression, however sure the fall is
_UNPAIRED = 0.02  # the same between runs of other loops
# a drop of the share of right answers that must be found with this power: of the same records, of
# records that differ in the same place of a grid, of other loops; where it is not, the check cannot
# tell
_REACH = {"same": 0.02, "place": 0.05, "other": 0.15}
_POWER = 0.8
_CHECKED_TRUTHS = ("sticky", "cycled")
_SCORE_BITS = 14  # of a score that count: 4 digits
# relative change of a score that an exact comparison lets pass: iterative fits on other processors
_SCORE_CHANGE = 1e-3
# what is counted: among positives or negatives, which answers are good; "no decision" is neither
# right nor wrong
_COUNTED = {
    "right": (None, ()),
    "detection": (True, (STICTION,)),
    "rejection": (False, (NO_STICTION,)),
    "no miss": (True, (STICTION, NO_DECISION)),
    "no false alarm": (False, (NO_STICTION, NO_DECISION)),
}


def check_run(
    folder: str | Path, against: str | Path, margin: float = MARGIN, exact: bool = False
) -> Check:
    """Compare a run with a baseline.

    Rates are compared within the positives and within the negatives of each label, since a moved
    threshold trades one for the other: a gate on accuracy alone would see little of it. Loops in
    the same place of the same grid: exact one-sided McNemar tests and DeLong's test of the AUC.
    Records there may differ, as another processor simulates a chaotic loop otherwise; an unchanged
    detector then loses as often as it wins, which is what these tests ask. Other loops: one-sided
    two-sample tests of a drop beyond 2 points. All are Holm-corrected to a chance of 5 % that
    unchanged detectors fail; on the very same records, where an unchanged detector answers the
    same, to 5 % a method. Only loops that a method covers count. Where a drop that matters
    (`_REACH`) would not have been found, the check cannot tell, and fails. With `exact`, every
    changed verdict of a built-in method fails as well, and so do records that are not the
    baseline's, on which nobody could tell.
    """
    now = read_book(folder)
    try:
        before = read_book(against)
    except NoRun:
        raise RunError(
            f"{against} holds no baseline; make this run one with `simbench check {folder}"
            f" --against {against} --update`"
        ) from None
    refuse_other_benchmark(now.manifest, before.manifest)
    return replace(compare_books(now, before, margin, exact), home=str(against))


def compare_books(
    now: RunArrays, before: RunArrays, margin: float = MARGIN, exact: bool = False
) -> Check:
    """Compare a run with a baseline, both as arrays; returns and errors as `check_run`."""
    grids, cells = ([b.manifest.get(key) for b in (now, before)] for key in ("grid", "cells_hash"))
    if (grids[0] != grids[1]) if None in cells else (cells[0] != cells[1]):
        content = "" if None in cells else f" ({cells[0]} and {cells[1]}: other cells)"
        raise RunError(
            f"the run is of grid {grids[0]!r}, the baseline of {grids[1]!r}{content}; run the"
            " baseline's grid"
        )
    pairs = pair(now, before)
    paired = pairs.now.size > 0
    basis = "other" if not paired else "same" if pairs.same.all() else "place"
    problems = _problems(now, before, pairs)
    rows: list[dict[str, Any]] = []
    flips: list[pd.DataFrame] = []
    for method in (m for m in before.methods if m in now.methods):
        i, j = now.methods.index(method), before.methods.index(method)
        for label in _CHECKED_TRUTHS:
            # a loop whose truth differs is another case
            alike = before.truth[label][pairs.before] == now.truth[label][pairs.now]
            one = _answers(before, j, label, pairs.before[alike] if paired else None)
            two = _answers(now, i, label, pairs.now[alike] if paired else None)
            rows += [{"method": method, "label": label, **row} for row in _tests(one, two, paired)]
        flips.append(_flips(now, i, before, j, pairs))
    of_sizes, untold = compared(now, before, pairs)
    rows += of_sizes
    tests = pd.DataFrame(
        rows, columns=["method", "label", "what", "n", "before", "now", "lost", "won", "p"]
    )
    each = tests.groupby("method", sort=False)["p"]
    size = each.transform("size") if basis == "same" else pd.Series(len(tests), index=tests.index)
    # an unchanged detector gives the same answers on the same records: only what changed can fail
    # by chance
    tests["p"] = each.transform(holm) if basis == "same" else holm(tests["p"])
    tests["seen"] = [
        _seen(row, basis, k) for row, k in zip(tests.to_dict("records"), size, strict=True)
    ]
    allowed = [row.get("allowed", margin if paired else 0.0) for row in rows]
    beyond = (
        np.where(tests["what"] == MEDIAN_ERROR, -1.0, 1.0) * (tests["before"] - tests["now"])
        > allowed
    )
    tests["worse"] = (tests["p"] < _LEVEL) & beyond
    moved = tests[beyond & ~tests["worse"] & tests["what"].isin((MEDIAN_ERROR, COVERAGE))]
    untold += [
        f"{sentence(row)}: cannot tell whether by chance" for row in moved.to_dict("records")
    ]
    unseen = (*_unseen(tests, basis), *untold)
    said = (
        f"{_basis(now, before, pairs, margin)}. A loss of {_points(_REACH[basis])}"
        " must be detectable in 8 of 10 such runs, else the run is too small"
    )
    every = pd.concat(flips, ignore_index=True) if flips else pd.DataFrame()
    if exact:
        problems += _changed(now, before, pairs, every)
    return Check(paired, said, tuple(problems), tests, every, unseen=unseen)


def update_baseline(folder: str | Path, baseline: str | Path) -> str:
    """Make a run the baseline, and say what that changes."""
    now, there = read_book(folder), (Path(baseline) / "manifest.json").exists()
    lines = [
        f"baseline {baseline}: {now.ids.size} scenarios of grid {now.manifest['grid']} x"
        f" {len(now.methods)} methods"
    ]
    if there:
        try:
            before = read_book(baseline)
            refuse_other_benchmark(now.manifest, before.manifest)
            lines += [f"+ method {m}" for m in now.methods if m not in before.methods]
            check = compare_books(now, before)
            changes = [*(f"- {reason}" for reason in check.reasons), *check.changes()]
            lines += changes or ["nothing moved"]
        except UserError as error:  # an unreadable baseline is replaced, and that is said
            lines.append(f"not compared with the old one: {error}")
    write_baseline(folder, baseline)
    return "\n".join(lines)


def _problems(now: RunArrays, before: RunArrays, pairs: Pairs) -> list[str]:
    found = [
        f"method {m} is in the baseline, not in the run"
        for m in before.methods
        if m not in now.methods
    ]
    missing = before.ids.size - pairs.before.size
    if missing and (pairs.one_grid or pairs.now.size):
        found.append(f"{missing} of the baseline's {before.ids.size} scenarios are not in the run")
    for label in _CHECKED_TRUTHS:
        moved = now.truth[label][pairs.now] != before.truth[label][pairs.before]
        changed = int((moved & pairs.same).sum())
        if changed:
            found.append(
                f"the truth {label!r} of {changed} scenarios with the same records has changed"
            )
    for method in (m for m in before.methods if m in now.methods):
        failed, was = (
            now.failed[now.methods.index(method)],
            before.failed[before.methods.index(method)],
        )
        raised = (
            int((failed[pairs.now] & ~was[pairs.before]).sum())
            if pairs.now.size
            else int(failed.sum())
        )
        if raised and (pairs.now.size or not was.any()):
            found.append(f"method {method} raised an error on {raised} scenarios where it had none")
    return found


def _changed(now: RunArrays, before: RunArrays, pairs: Pairs, flips: pd.DataFrame) -> Iterator[str]:
    """Return what an exact comparison does not let pass: changed verdicts and scores of built-in
    methods, and other records.
    """
    differ = int((~pairs.same).sum())
    if not pairs.now.size:
        yield "exact: the run has no record of the baseline"
    elif differ:
        yield (
            f"exact: {differ} of {pairs.now.size} records differ from the baseline's: verdicts"
            " cannot be compared there"
        )
    strangers = {name.removeprefix("own ") for name in now.manifest.get("plugins", ())}
    for method in (m for m in before.methods if m in now.methods and m not in strangers):
        changed = int((flips["method"] == method).sum()) if len(flips) else 0
        if changed:
            yield f"exact: {changed} of {pairs.now.size} verdicts of {method} changed"
        one = before.score[before.methods.index(method)][pairs.before]
        two = now.score[now.methods.index(method)][pairs.now]
        other = ~np.isclose(one, two, _SCORE_CHANGE, 0.0, equal_nan=True) & pairs.same
        if other.sum() > changed:  # a changed verdict may well have another score
            yield f"exact: {other.sum()} of {pairs.now.size} scores of {method} changed"


def _basis(now: RunArrays, before: RunArrays, pairs: Pairs, margin: float) -> str:
    tests = f"a rate may fall by {_points(margin)} (exact paired tests with Holm's correction)"
    differ = int((~pairs.same).sum())
    if pairs.now.size and not differ:
        return (
            f"all {pairs.now.size} records equal those of the baseline bit for bit. Rule: {tests}"
        )
    if pairs.now.size:
        ids = int((now.ids[pairs.now] != before.ids[pairs.before]).sum())
        moved = int((now.truth["cycled"][pairs.now] != before.truth["cycled"][pairs.before]).sum())
        why = (
            f"{differ} of {pairs.now.size} records differ from the baseline's in the same place of"
            " the grid"
        )
        more = f"{ids} also in their id, {moved} in the truth 'cycled', which are left out there"
        return f"{why} ({more}), as on another processor. Rule: {tests}"
    return (
        f"the loops are not those of the baseline; two-sample tests compare {now.ids.size} with"
        f" {before.ids.size} scenarios. A rate may fall by {_points(_UNPAIRED)}"
        " (Holm's correction)"
    )


def _points(share: float) -> str:
    """Return a share in percentage points."""
    return f"{100 * share:g} percentage point{'s' * (share != 0.01)}"


def _seen(row: dict[str, Any], basis: str, tests: int) -> float:
    """Return the smallest drop of a rate that is found with `_POWER`; NaN for an AUC and a median
    error.
    """
    n, level = row["n"], _LEVEL / tests
    if row["what"] in ("AUC", MEDIAN_ERROR) or n == 0:
        return float("nan")
    if basis == "other":
        spread = np.sqrt(2 * max(row["before"] * (1 - row["before"]), 1 / (n + 2)) / n)
        return float(
            min(_UNPAIRED + spread * (stats.norm.isf(level) + stats.norm.ppf(_POWER)), 1.0)
        )
    least = np.ceil(-np.log2(level))  # cases lost, none won, that an exact test takes for a drop
    return float(min(stats.gamma.ppf(_POWER, least) / n, 1.0))


def _unseen(tests: pd.DataFrame, basis: str) -> Iterator[str]:
    """Name the methods whose loss nobody could have found: too few loops that they cover, and
    answers that changed.
    """
    for row in tests[(tests["what"] == "right") & (tests["label"] == "cycled")].to_dict("records"):
        changed = basis != "same" or row["lost"] > 0
        if (
            changed
            and not row["seen"] <= _REACH[basis]
            and not tests.loc[tests["method"] == row["method"], "worse"].any()
        ):
            why = (
                f"only a loss of {row['seen']:.3f} would have been found"
                if row["n"]
                else "it covers none"
            )
            yield (
                f"{row['method']}: cannot tell on the {row['n']} loops that it covers: {why},"
                f" {_REACH[basis]:g} is asked for"
            )


def _rounded(score: np.ndarray) -> np.ndarray:
    """Return scores with `_SCORE_BITS` bits, so that last bits break no ties between loops."""
    mantissa, exponent = np.frexp(score.astype(np.float32))  # as a baseline keeps them
    return np.ldexp(np.round(mantissa * 2.0**_SCORE_BITS), exponent - _SCORE_BITS)


def _answers(
    book: RunArrays, method: int, label: str, at: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    truth, verdict, score = book.truth[label], book.verdict[method], _rounded(book.score[method])
    covered = book.applicable[method] != 0
    if at is not None:
        truth, verdict, score, covered = truth[at], verdict[at], score[at], covered[at]
    return truth, verdict, score, covered


def _tests(before: tuple, now: tuple, paired: bool) -> Iterator[dict[str, Any]]:
    # side by side, a loop that the method covered before counts: what it gives up now it has lost
    covered = [before[3], before[3] if paired else now[3]]
    used = [cover & (side[0] >= 0) for cover, side in zip(covered, (before, now), strict=True)]
    sides = [tuple(x[use] for x in side[:3]) for use, side in zip(used, (before, now), strict=True)]
    (truth_a, said_a, score_a), (truth_b, said_b, score_b) = (
        (truth == 1, said, score) for truth, said, score in sides
    )
    for what, (positive, good) in _COUNTED.items():
        if positive is None:
            a, b = said_a == truth_a, said_b == truth_b
        else:
            codes = [CODES[word] for word in good]
            a, b = (
                np.isin(said_a[truth_a == positive], codes),
                np.isin(said_b[truth_b == positive], codes),
            )
        row: dict[str, Any] = {
            "what": what,
            "n": min(a.size, b.size),
            "before": _share(a),
            "now": _share(b),
        }
        if paired:
            row.update(lost=int((a & ~b).sum()), won=int((~a & b).sum()))
            yield {**row, "p": mcnemar(row["lost"], row["won"], worse=True)}
        else:
            yield {**row, "p": rate_drop(int(a.sum()), a.size, int(b.sum()), b.size, _UNPAIRED)}
    p = (
        auc_drop(score_a, score_b, truth_a)
        if paired
        else auc_drop_unpaired(score_a, truth_a, score_b, truth_b, _UNPAIRED)
    )
    yield {
        "what": "AUC",
        "n": min(truth_a.size, truth_b.size),
        "before": auc(score_a, truth_a).value,
        "now": auc(score_b, truth_b).value,
        "p": p,
    }


def _share(right: np.ndarray) -> float:
    return float(right.mean()) if right.size else float("nan")


def _flips(now: RunArrays, i: int, before: RunArrays, j: int, pairs: Pairs) -> pd.DataFrame:
    changed = now.verdict[i][pairs.now] != before.verdict[j][pairs.before]
    at, was_at = pairs.now[changed], pairs.before[changed]
    names = np.array([w for w, _ in sorted(CODES.items(), key=lambda item: item[1])])
    return pd.DataFrame(
        {
            "scenario_id": before.ids[was_at].astype(str),
            "method": now.methods[i],
            "was": names[before.verdict[j][was_at]],
            "now": names[now.verdict[i][at]],
            "record": np.where(pairs.same[changed], "same", "other"),
            "sticky": now.truth["sticky"][at] == 1,
            "cycled": now.truth["cycled_word"][at],
            **{name: now.axes[name][at] for name in ("block", "disturbance")},
        }
    )
