"""Gate: has a detector become worse? A run against a baseline, loop by loop by their ids."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from simbench.bench.check.baseline import write_baseline
from simbench.bench.check.check_power import (
    COUNTED,
    LEVEL,
    loops_needed,
    may_fall,
    points,
    say_power,
    smallest_seen,
    unseen_losses,
)
from simbench.bench.check.check_result import Check, sentence
from simbench.bench.score.compare import Paired, Pairs, pair
from simbench.bench.score.names import ALL
from simbench.bench.score.quantification import COVERAGE, MEDIAN_ERROR, compared
from simbench.bench.statistics import auc, auc_drop, holm
from simbench.bench.store.benchmark import benchmark_version, refuse_other_benchmark
from simbench.bench.store.folder import NoRun
from simbench.bench.store.manifest import own_methods
from simbench.bench.store.reading import CODES, COPIES, RunArrays, RunError, read_book
from simbench.detectors.errors import UserError

MARGIN = 0.01  # of a rate: what falls by less is no regression, however sure the fall is
_CHECKED_TRUTHS = ("sticky", "cycled")
_SCORE_BITS = 14  # of a score that count: 4 digits
# relative change of a score that an exact comparison lets pass: iterative fits
_SCORE_CHANGE = 1e-3


def check_run(
    folder: str | Path,
    against: str | Path,
    margin: float = MARGIN,
    exact: bool = False,
) -> Check:
    """Compare a run with a baseline, loop by loop where both have the same id.

    Rates are compared within the positives and within the negatives of each label, since a moved
    threshold trades one for the other: a gate on accuracy alone would see little of it. Exact
    one-sided McNemar tests and DeLong's test of the AUC ask whether more answers are lost than
    chance explains; all are Holm-corrected to a chance of 5 % that unchanged detectors fail, on the
    very same records, where an unchanged detector answers the same, to 5 % a method. A record may
    have other bits than the baseline's, as another processor simulates a chaotic loop otherwise;
    how many do is stated. Only loops that a method covers count. Where answers are lost, and a loss
    that matters (`REACH`) would not have been found, the check cannot tell. With `exact`, for runs
    of one machine, every changed verdict of a built-in method fails as well, and so do records that
    are not the baseline's.
    """
    now = read_book(folder)
    try:
        before = read_book(against)
    except NoRun:
        raise RunError(
            f"{against} holds no baseline; make this run one with `simbench check {folder}"
            f" --against {against} --update`"
        ) from None
    pairs = pair(now, before)
    refuse_other_benchmark(now.manifest, before.manifest, pairs.now.size)
    return replace(check_books(now, before, margin, exact), home=str(against))


def check_books(
    now: RunArrays,
    before: RunArrays,
    margin: float = MARGIN,
    exact: bool = False,
) -> Check:
    """Compare a run with a baseline, both as arrays; returns and errors as `check_run`."""
    # the loops that both have, each record once
    before = before.without_copies()
    pairs = pair(now, before)
    if not pairs.now.size:
        raise RunError(
            f"the run of grid {now.manifest.get('grid')!r} and the baseline of grid"
            f" {before.manifest.get('grid')!r} have no scenario in common; run the baseline's own:"
            " simbench run BASELINE"
        )

    # every rate of every method that both have, and the answers that changed
    basis = "equal" if pairs.same.all() else "other bits"
    problems = _find_problems(now, before, pairs)
    rows: list[dict[str, Any]] = []
    flips: list[pd.DataFrame] = []
    for method in (m for m in before.methods if m in now.methods):
        i = now.methods.index(method)
        j = before.methods.index(method)
        for truth in _CHECKED_TRUTHS:
            # a loop whose truth differs is another case
            alike = before.truth[truth][pairs.before] == now.truth[truth][pairs.now]
            at = pairs.now[alike]
            was_at = pairs.before[alike]
            sides = _select_answers(before, j, truth, was_at), _select_answers(now, i, truth, at)
            rows += [{"method": method, "truth": truth, **row} for row in _test_method(*sides)]
        flips.append(_list_flips(now, i, before, j, pairs))

    # sizes of stiction as further rates, and all of them with p corrected for their number
    of_sizes, untold = compared(now, before, pairs)
    rows += of_sizes
    tests = pd.DataFrame(
        rows,
        columns=["method", "truth", "what", "n", "before", "now", "lost", "won", "p"],
    )
    tests.insert(2, "population", ALL)
    each = tests.groupby("method", sort=False)["p"]
    if basis == "equal":
        size = each.transform("size")
    else:
        size = pd.Series(len(tests), index=tests.index)

    # an unchanged detector gives the same answers on the same records: only what changed can fail
    # by chance
    if basis == "equal":
        tests["p"] = each.transform(holm)
    else:
        tests["p"] = holm(tests["p"])

    # what could have been seen, and what is worse by more than the margin and than chance
    allowed = [row.get("allowed", margin) for row in rows]
    cases = list(zip(tests.to_dict("records"), size, allowed, strict=True))
    tests["seen"] = [smallest_seen(row, LEVEL / k, spared) for row, k, spared in cases]
    tests["may_fall"] = [may_fall(row, LEVEL / k, spared) for row, k, spared in cases]
    beyond = (
        np.where(tests["what"] == MEDIAN_ERROR, -1.0, 1.0) * (tests["before"] - tests["now"])
        > allowed
    )
    tests["worse"] = (tests["p"] < LEVEL) & beyond
    moved = tests[beyond & ~tests["worse"] & tests["what"].isin((MEDIAN_ERROR, COVERAGE))]
    for row in moved.to_dict("records"):
        untold.append(f"{sentence(row)}: cannot tell whether by chance")

    # what nobody could tell
    if flips:
        every = pd.concat(flips, ignore_index=True)
    else:
        every = pd.DataFrame()
    if len(every):
        changed = set(every["method"])
    else:
        changed = set()
    unseen = tuple(unseen_losses(tests, basis, changed)) + tuple(untold)
    tests = tests.drop(columns="may_fall")

    # in words
    said = (
        f"{_describe_rule(now, before, pairs, margin)}. {say_power(tests, basis)}. Benchmark:"
        f" {benchmark_version(now.manifest)}"
    )
    if exact:
        problems += _find_changes(now, before, pairs, every)
    return Check(
        said, tuple(problems), tests, every, _count_equal_bits(pairs, before, every), unseen=unseen
    )


def _count_equal_bits(pairs: Pairs, before: RunArrays, flips: pd.DataFrame) -> dict[str, int]:
    """Return how many loops have equal bits, other bits with the same verdicts, and another
    verdict.
    """
    if len(flips):
        turned = set(flips["scenario_id"])
    else:
        turned = set()
    same_verdict = np.array(
        [ident not in turned for ident in before.ids[pairs.before].astype(str).tolist()]
    )
    return {
        "equal": int((pairs.same & same_verdict).sum()),
        "other_bits": int((~pairs.same & same_verdict).sum()),
        "other_verdict": int((~same_verdict).sum()),
    }


def update_baseline(folder: str | Path, baseline: str | Path) -> str:
    """Make a run the baseline, and say what that changes."""
    # The run by itself: what a comparison with it can show
    now = read_book(folder)
    there = (Path(baseline) / "manifest.json").exists()
    lines = [
        f"baseline {baseline}: {now.ids.size} scenarios of grid {now.manifest['grid']} x"
        f" {len(now.methods)} methods"
    ]
    itself = check_books(now, now)
    lines.append(f"{say_power(itself.tests, 'equal')}; {loops_needed(itself)}")

    # What differs from the baseline that is there
    if there:
        try:
            before = read_book(baseline)
            refuse_other_benchmark(now.manifest, before.manifest, pair(now, before).now.size)
            lines += [f"+ method {m}" for m in now.methods if m not in before.methods]
            check = check_books(now, before)
            changes = [f"- {reason}" for reason in check.reasons] + check.changes()
            lines += changes or ["nothing moved"]
        except UserError as error:  # an unreadable baseline is replaced, and that is said
            lines.append(f"not compared with the old one: {error}")

    # The run takes its place
    write_baseline(folder, baseline)
    return "\n".join(lines)


def _find_problems(now: RunArrays, before: RunArrays, pairs: Pairs) -> list[str]:
    # Methods and scenarios that the run lacks
    found = []
    for m in before.methods:
        if m not in now.methods:
            found.append(f"method {m} is in the baseline, not in the run")
    missing = before.ids.size - pairs.before.size
    if missing:
        found.append(f"{missing} of the baseline's {before.ids.size} scenarios are not in the run")

    # Truths that changed on records with equal bits
    for truth in _CHECKED_TRUTHS:
        moved = now.truth[truth][pairs.now] != before.truth[truth][pairs.before]
        changed = int((moved & pairs.same).sum())
        if changed:
            found.append(
                f"the truth {truth!r} of {changed} scenarios with the same records has changed"
            )

    # Methods that fail where they did not
    for method in (m for m in before.methods if m in now.methods):
        failed = now.failed[now.methods.index(method)]
        was = before.failed[before.methods.index(method)]
        raised = int((failed[pairs.now] & ~was[pairs.before]).sum())
        if raised:
            found.append(f"method {method} raised an error on {raised} scenarios where it had none")
    return found


def _find_changes(
    now: RunArrays, before: RunArrays, pairs: Pairs, flips: pd.DataFrame
) -> Iterator[str]:
    """Return what an exact comparison does not let pass: changed verdicts and scores of built-in
    methods, and other records.
    """
    # Records with other bits cannot be compared exactly
    differ = int((~pairs.same).sum())
    if differ:
        yield (
            f"exact: {differ} of {pairs.now.size} records differ from the baseline's: verdicts"
            " cannot be compared there; --exact is for two runs of one machine"
        )

    # Verdicts of the package's methods, then their scores
    own = own_methods(now.manifest)
    for method in (m for m in before.methods if m in now.methods and m not in own):
        if len(flips):
            changed = int((flips["method"] == method).sum())
        else:
            changed = 0
        if changed:
            yield f"exact: {changed} of {pairs.now.size} verdicts of {method} changed"
        one = before.score[before.methods.index(method)][pairs.before]
        two = now.score[now.methods.index(method)][pairs.now]
        other = ~np.isclose(one, two, _SCORE_CHANGE, 0.0, equal_nan=True) & pairs.same
        if other.sum() > changed:  # a changed verdict may well have another score
            yield f"exact: {other.sum()} of {pairs.now.size} scores of {method} changed"


def _describe_rule(now: RunArrays, before: RunArrays, pairs: Pairs, margin: float) -> str:
    # The rule of the paired tests
    tests = f"a rate may fall by {points(margin)} (exact paired tests with Holm's correction)"
    if copies := before.manifest.get(COPIES):
        tests += f"; {copies} copies of records with the same labels do not count"

    # Bits: all equal, or how many differ and where
    differ = int((~pairs.same).sum())
    if not differ:
        return (
            f"all {pairs.now.size} records equal those of the baseline bit for bit. Rule: {tests}"
        )
    loops = int((now.digests[pairs.now] != before.digests[pairs.before]).sum())
    moved = int((now.truth["cycled"][pairs.now] != before.truth["cycled"][pairs.before]).sum())
    why = (
        f"the bits of {differ} of {pairs.now.size} records differ from the baseline's, as on"
        f" another processor ({loops} were settled as other loops, {moved} differ in the truth"
        " 'cycled' and are left out there)"
    )
    return f"{why}. Rule: {tests}"


def _round_scores(score: np.ndarray) -> np.ndarray:
    """Return scores with `_SCORE_BITS` bits, so that last bits break no ties between loops."""
    mantissa, exponent = np.frexp(score.astype(np.float32))  # as a baseline keeps them
    return np.ldexp(np.round(mantissa * 2.0**_SCORE_BITS), exponent - _SCORE_BITS)


def _select_answers(
    book: RunArrays, method: int, truth: str, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return label, verdict, score and whether the method covers the loop, of some loops."""
    covered = book.applicable[method][at] != 0
    return (
        book.truth[truth][at],
        book.verdict[method][at],
        _round_scores(book.score[method][at]),
        covered,
    )


def _mark_good_answers(positive: np.ndarray, said: np.ndarray) -> dict[str, np.ndarray]:
    """Return for each kind of answer that is counted whether it was given, loop by loop."""
    found = {}
    for what, (among, good) in COUNTED.items():
        if among is None:
            found[what] = said == positive
        else:
            codes = [CODES[word] for word in good]
            found[what] = np.isin(said[positive == among], codes)
    return found


def _test_method(before: tuple, now: tuple) -> Iterator[dict[str, Any]]:
    """Yield the tests of one method and truth."""
    # a loop that the method covered before counts: what it gives up now it has lost
    used = before[3] & (before[0] >= 0)
    truth, said_a, score_a = (x[used] for x in before[:3])
    said_b, score_b = (x[used] for x in now[1:3])
    positive = truth == 1
    old = _mark_good_answers(positive, said_a)
    new = _mark_good_answers(positive, said_b)
    for what in COUNTED:
        a = old[what]
        b = new[what]
        paired = Paired.of(a, b)
        row = {"what": what, "n": paired.n, "before": _share_right(a), "now": _share_right(b)}
        yield {**row, "lost": paired.win, "won": paired.loss, "p": paired.p_worse}
    yield {
        "what": "AUC",
        "n": truth.size,
        "before": auc(score_a, positive).value,
        "now": auc(score_b, positive).value,
        "p": auc_drop(score_a, score_b, positive),
    }


def _share_right(right: np.ndarray) -> float:
    if right.size:
        return float(right.mean())
    return float("nan")


def _list_flips(now: RunArrays, i: int, before: RunArrays, j: int, pairs: Pairs) -> pd.DataFrame:
    # The loops on which the method answers otherwise
    changed = now.verdict[i][pairs.now] != before.verdict[j][pairs.before]
    at = pairs.now[changed]
    was_at = pairs.before[changed]
    names = np.array([w for w, _ in sorted(CODES.items(), key=lambda item: item[1])])

    # Their old and new answer, with what the loops are
    return pd.DataFrame(
        {
            "scenario_id": before.ids[was_at].astype(str),
            "method": now.methods[i],
            "was": names[before.verdict[j][was_at]],
            "now": names[now.verdict[i][at]],
            "bits": np.where(pairs.same[changed], "equal", "other"),
            "sticky": now.truth["sticky"][at] == 1,
            "cycled": now.truth["cycled_word"][at],
            **{name: now.axes[name][at] for name in ("block", "disturbance")},
        }
    )
