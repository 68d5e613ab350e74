"""Score a run: every detector where it applies, by truth, process and population, and by axis."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from simbench.bench.score.answers import (
    Answers,
    answers_of,
    axis_codes,
    failing_methods,
    reference_answers,
)
from simbench.bench.score.folds import folds_of, found_at, risk_coverage
from simbench.bench.score.names import (
    ALL,
    OF_NOT_OSCILLATING,
    OF_OSCILLATING,
    SAMPLED,
    kind_of,
)
from simbench.bench.score.quantification import quantification
from simbench.bench.score.ranks import RANKED_LOOPS, UNDECIDED, Ranks, rank_methods
from simbench.bench.score.rates import coded, counted, rates_of
from simbench.bench.score.result import Scores
from simbench.bench.score.shipped import read_joined, with_shipped
from simbench.bench.score.stability import RankStability, stability
from simbench.bench.statistics import area, auc, dense_ranks, rate, wilson
from simbench.bench.store.reading import CODES, TRUTHS, RunArrays
from simbench.detectors.signal.conditioning import median
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.scenarios.cell import ULTIMATE

if TYPE_CHECKING:
    import pandas as pd

# where each stands among the counts of answers
_PROCESSES = {ALL: slice(None), "self-regulating": slice(1), "integrating": slice(1, 2)}
_POPULATIONS = {
    ALL: slice(None),
    OF_OSCILLATING: slice(1, 2),
    OF_NOT_OSCILLATING: slice(1),
}
_LEFT_OUT = ("entrained", "unclear")
_EACH = ("said", "applies", "failed", "runtime")
_COVERED = 0.9  # of a block's loops: a method that answers fewer has no rank there


def score_run(
    folder: str | Path, undecided: float = UNDECIDED, allow_failed: float = 0.0
) -> Scores:
    """Score a finished run."""
    return score_book(read_joined(folder), undecided, allow_failed)


def score_book(book: RunArrays, undecided: float = UNDECIDED, allow_failed: float = 0.0) -> Scores:
    """Score a run that is in memory; see `score_run`.

    A method that raised an error on more than `allow_failed` of its records has no rank.
    """
    book = with_shipped(book)
    rows, by_axis = [], []
    standing, stable = {}, {}
    reference, failing = reference_answers(book), failing_methods(book, allow_failed)
    blind = reference[0]
    some = np.flatnonzero(blind.applies)
    process = np.select([book.axes["process"] == x for x in ("foptd", "integrating")], [0, 1], 2)
    # 0 does not oscillate, 1 does, 2 is not ranked
    going_on = np.where(book.apart, 2, book.oscillating)
    axes = {axis: axis_codes(book, axis) for axis in book.along}
    whole = [*answers_of(book), *reference]
    codes = [coded(a) for a in whole]
    # the order of the scores is all that counts, and found once
    everyone = [
        a._replace(score=dense_ranks(a.score[some]), **{x: getattr(a, x)[some] for x in _EACH})
        for a in whole
    ]
    for truth in TRUTHS:
        known = book.truth[truth].astype(int) + 1
        counts = counted(9 * known + 3 * process + going_on, (3, 3, 3), codes)
        for (kind, of), (population, going) in product(_PROCESSES.items(), _POPULATIONS.items()):
            place = {"truth": truth, "process": kind, "population": population}
            here = _chosen(process[some], of) & _chosen(going_on[some], going)
            block = _block(book, truth, here, place, blind)
            # where nothing oscillates no score tells loops apart
            found = [
                _row(block, a, c[:, of, going].sum((1, 2)), undecided, going != slice(1))
                for a, c in zip(everyone, counts, strict=True)
            ]
            ranks, ranked = _rank(block, everyone, found, undecided, failing)
            standing[truth, kind, population] = ranks
            rows += found
            if (kind, population) == (ALL, OF_OSCILLATING):
                stable[truth] = _stability(book, truth, [whole[k] for k in ranked], undecided)
    known = book.truth["cycled"].astype(int) + 1
    for axis, (values, code) in axes.items():
        size = len(values) + 1
        counts = counted(size * known + code, (3, size), codes)
        for k, value in enumerate(values):
            place = {"axis": axis, "value": value, "truth": "cycled"}
            block = _block(book, "cycled", code[some] == k, place, blind)
            by_axis += [
                _row(block, a, c[:, k], undecided, interval=False)
                for a, c in zip(everyone, counts, strict=True)
            ]
    left_out = _left_out(book, whole, codes)
    frames = [_frame(part, {"axis": "", "value": "", **rows[0]}) for part in (rows, by_axis)]
    by_cause = _frame([*_by_cause(book, whole, codes)], {})
    other = _disagreement(book), _frame(left_out, {}), by_cause, quantification(book)
    sizes = {"scenarios": int(book.ids.size), OF_OSCILLATING: int((going_on == 1).sum())}
    if some.size < book.ids.size:
        sizes[SAMPLED] = some.size
    return Scores(*frames, *other, standing, book.manifest, sizes, stable, failing, undecided, book)


def _chosen(numbers: np.ndarray, of: slice) -> np.ndarray:
    """Return which of some small numbers lie in a slice."""
    return np.isin(numbers, np.arange(3)[of])


def _frame(rows: list[dict[str, Any]], example: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    there = [r for r in rows if r["n"]]
    # where no loop has a truth, the table has its columns all the same
    return (
        pd.DataFrame(there) if there else pd.DataFrame(columns=list(rows[0] if rows else example))
    )


class _Block(NamedTuple):
    """The loops of one row that have the truth asked for, of a large run those of its sample: which
    are positive, in what group and fold.

    `blind` is what the classifier that knows no waveform says of these.
    """

    place: dict[str, Any]
    use: np.ndarray
    positive: np.ndarray
    groups: np.ndarray
    folds: np.ndarray
    blind: np.ndarray


def _block(
    book: RunArrays, truth: str, chosen: np.ndarray, place: dict[str, Any], blind: Answers
) -> _Block:
    some = np.flatnonzero(blind.applies)
    label = book.truth[truth][some]
    use = np.flatnonzero(chosen & (label >= 0))
    groups = np.unique(book.groups[some][use], return_inverse=True)[1]
    return _Block(place, use, label[use] == 1, groups, folds_of(groups), blind.said[some][use])


def _row(
    block: _Block, a: Answers, counts: np.ndarray, cost: float, interval: bool = True
) -> dict[str, Any]:
    """Return a row: what is a count, of all loops; orders and spreads of those in the block.

    `counts` are answers by truth (unknown, no, yes), by what was said, whether the method applies,
    and whether it failed.
    """
    use, applies, positive = block.use, a.applies[block.use], block.positive
    here, groups, folds, blind = use, block.groups, block.folds, block.blind
    if not applies.all():
        here, positive, groups, folds, blind = (
            x[applies] for x in (use, positive, groups, folds, blind)
        )
    said = a.said[here]
    no, yes = counts[1:, :, 1].sum(-1).tolist()
    n, m, p = int(counts[1:].sum()), sum(no) + sum(yes), sum(yes)
    right, undecided = no[0] + yes[1], no[2] + yes[2]
    row: dict[str, Any] = {
        "method": a.method,
        **block.place,
        "role": a.role,
        "sees_mv": a.sees_mv,
        "home": a.home,
        "division": a.division,
        "name": a.name,
        "verified": a.verified,
        "answered": a.answered,
        "own": a.own,
    }
    row.update(n=n, n_all=int(counts.sum()), positives=int(counts[2].sum()), applicable=m)
    row |= rates_of(counts)
    row |= {
        "missed": yes[0] / p if p else math.nan,
        "no_decision_positives": yes[2] / p if p else math.nan,
        "no_decision_negatives": no[2] / (m - p) if m > p else math.nan,
    }
    earned = _earned(said, positive, cost)
    mean = (m - right - (1.0 - cost) * undecided) / m if m else math.nan
    ranges = {"cost": _mean_of_groups(1.0 - earned, groups, 0.0, mean, m)}
    score = a.score[here]
    if interval:
        sticky = int(positive.sum())
        both = 0 < sticky < positive.size
        found = rate(found_at(score, positive, folds), sticky) if both else rate(0, 0)
        sure = risk_coverage(score, positive, folds)[1]
        ranges |= {
            "cost_over_no_waveform": _mean_of_groups(
                _earned(blind, positive, cost) - earned, groups, -1.0
            ),
            "sensitivity_at_5": found,
            "risk_coverage": _mean_of_groups(sure, groups),
        }
    for name, ends in ranges.items():
        row[name], row[f"{name}_lo"], row[f"{name}_hi"] = ends
    if not (known := score >= 0).all():
        score, positive = score[known], positive[known]
    row["scored"] = score.size
    if interval:
        row["auc"], row["auc_lo"], row["auc_hi"] = auc(score, positive)
    else:
        row["auc"] = area(score, positive)
    row["errors"] = int(counts[1:, ..., 1].sum())
    row["median_ms"] = round(1e3 * median(a.runtime[use]), 4) if use.size else math.nan
    return row


def _earned(said: np.ndarray, positive: np.ndarray, cost: float) -> np.ndarray:
    """Return 1 where right, 0 where wrong, and 1 less its cost where nothing was decided."""
    return np.where(said == CODES["no_decision"], 1.0 - cost, said == positive)


def _mean_of_groups(
    values: np.ndarray,
    groups: np.ndarray,
    least: float = 0.0,
    of_all: float | None = None,
    n: int = 0,
) -> tuple[float, float, float]:
    """Return a mean of values from `least` to 1 with its 95 % interval; values of one group hang
    together.

    Where the values are a sample, `of_all` is the mean of all `n`.
    """
    if not values.size:
        return math.nan if of_all is None else of_all, least, 1.0
    mean = float(values.mean())
    shares = np.bincount(groups, values - mean)
    # one value of 0 and one of 1 added: few loops that all cost the same do not show the cost
    # exactly
    size = values.size + 2
    alone = (float(values @ values) + 1.0) / size - ((float(values.sum()) + 1.0) / size) ** 2
    variance = max(float(shares @ shares) / values.size, alone)
    mean, n = (mean, values.size) if of_all is None else (of_all, n)
    half = 1.96 * math.sqrt(variance / n)
    return mean, max(mean - half, least), min(mean + half, 1.0)


def _left_out(
    book: RunArrays, everyone: list[Answers], codes: list[np.ndarray]
) -> list[dict[str, Any]]:
    """Count what every method says of loops that no score against `cycled` holds, and of those it
    does not apply to.
    """
    words = [book.truth["cycled_word"] == word for word in _LEFT_OUT]
    kind = np.select([*words, book.truth["cycled"] >= 0], [0, 1, 2], 3)
    rows = []
    for a, c in zip(everyone, counted(kind, (4,), codes), strict=True):
        by_kind = zip((*_LEFT_OUT, "does not apply"), c.sum(-1), (1, 1, 0), strict=False)
        for of, answers, applies in by_kind:
            n = int(answers[:, applies].sum())
            row: dict[str, Any] = {"method": a.method, "role": a.role, "of": of, "n": n}
            for word, code in CODES.items():
                said = int(answers[code, applies])
                row[word] = said / n if n else math.nan
                row[f"{word}_lo"], row[f"{word}_hi"] = map(float, wilson(said, n))
            rows.append(row)
    return rows


def _by_cause(
    book: RunArrays, everyone: list[Answers], codes: list[np.ndarray]
) -> Iterator[dict[str, Any]]:
    """Yield how often every method calls loops sticky that the valve does not make cycle, by what
    makes them oscillate.
    """
    texts, places = axis_codes(book, "echo")
    kinds = np.array([*texts, ""])[places]
    echoes = [kind for kind in dict.fromkeys(kinds) if kind not in ("", "none")]
    causes = (*(f"echo, {kind}" for kind in echoes), "own tuning", "no oscillation", "other")
    place = np.select(
        [
            # echoes of several cuts have a table of their own
            (book.truth["cycled"] != 0) | (book.apart & ~np.isnan(book.axes["cut"])),
            *(kinds == kind for kind in echoes),
            np.isin(book.axes["tuning"].astype(str), list(ULTIMATE)),
            ~book.oscillating,
        ],
        [len(causes), *range(len(causes) - 1)],
        len(causes) - 1,
    )
    for a, c in zip(everyone, counted(place, (len(causes) + 1,), codes), strict=True):
        for cause, answers in zip(causes, c.sum(-1), strict=False):
            n = int(answers[:, 1].sum())
            said, undecided = (int(answers[CODES[w], 1]) for w in (STICTION, NO_DECISION))
            share, lo, hi = rate(said, n)
            row: dict[str, Any] = {"method": a.method, "role": a.role, "cause": cause, "n": n}
            row |= {"false_positives": share, "false_positives_lo": lo, "false_positives_hi": hi}
            yield row | {"no_decision": undecided / n if n else math.nan}


def _rank(
    block: _Block,
    everyone: list[Answers],
    rows: list[dict[str, Any]],
    cost: float,
    failing: dict[str, int],
) -> tuple[Ranks, list[int]]:
    """Write a rank into each row of a block, and return what it can resolve with the numbers of the
    methods ranked together.

    Methods with MV are ranked among themselves. No rank have reference rows, methods that answer a
    part of the loops, methods that failed too often, and anyone where too few loops have a label. A
    method of whoever ran the grid always has one: where it answers a part of the loops, among those
    that answer these.
    """
    standing, n = [], rows[0]["n"]
    for row in rows:
        row["rank"], row["rank_loops"] = math.nan, 0
    for kind in (0, 1):
        mine = [
            k
            for k, a in enumerate(everyone)
            if kind_of(a.role, a.sees_mv) == kind and a.method not in failing
        ]
        # a rank compares methods on the same loops
        members = [k for k in mine if n >= RANKED_LOOPS and rows[k]["applicable"] >= _COVERED * n]
        earned = {k: _earned_on_average(block, everyone[k], cost) for k in mine}
        means = [1.0 - rows[k]["cost"] for k in members]
        ranks = rank_methods(
            np.reshape([earned[k] for k in members], (len(members), block.use.size)),
            block.groups,
            np.array(means),
            n,
        )
        for k, rank in zip(members, ranks.rank, strict=True):
            rows[k]["rank"], rows[k]["rank_loops"] = int(rank), n
        standing.append((ranks, members))
        for k in (k for k in mine if everyone[k].own and k not in members):
            if rows[k]["applicable"] >= RANKED_LOOPS:
                rows[k]["rank"] = _rank_where_it_answers(block, everyone, earned, k)
                rows[k]["rank_loops"] = rows[k]["applicable"]
    return standing[0] if standing[0][1] else standing[1]


def _earned_on_average(block: _Block, a: Answers, cost: float) -> np.ndarray:
    """Return what a method earns on each loop of a block: where it does not answer, what it earns
    elsewhere, so that a gap neither helps nor harms it.
    """
    earned, applies = _earned(a.said[block.use], block.positive, cost), a.applies[block.use]
    return np.where(applies, earned, earned[applies].mean() if applies.any() else 0.0)


def _rank_where_it_answers(
    block: _Block, everyone: list[Answers], earned: Mapping[int, np.ndarray], own: int
) -> int:
    """Return the rank of a method among those that answer the loops that it answers."""
    here = everyone[own].applies[block.use]
    peers = [k for k in earned if everyone[k].applies[block.use][here].mean() >= _COVERED]
    ranks = rank_methods(np.array([earned[k][here] for k in peers]), block.groups[here])
    return int(ranks.rank[peers.index(own)])


def _stability(
    book: RunArrays, truth: str, ranked: Sequence[Answers], cost: float
) -> RankStability:
    """Return how stable the order of the ranked methods is on loops that oscillate, with halves
    drawn from the run's seed.
    """
    use = np.flatnonzero(book.oscillating & ~book.apart & (book.truth[truth] >= 0))
    positive = book.truth[truth][use] == 1
    earned = {a.method: _earned(a.said[use], positive, cost) * a.applies[use] for a in ranked}
    right = {a.method: a.said[use] == positive for a in ranked}
    return stability(earned, right, book.groups[use], int(book.manifest.get("seed") or 0))


def _disagreement(book: RunArrays) -> pd.DataFrame:
    import pandas as pd

    def word(codes: np.ndarray) -> np.ndarray:
        return np.array(["no cell", "no", "yes"])[codes + 1]

    said = {"sticky": word(book.truth["sticky"]), "predicted": word(book.truth["predicted"])}
    frame = pd.DataFrame({**said, "cycled": book.truth["cycled_word"]})
    counts = frame.value_counts(sort=False).rename("scenarios").reset_index()
    return counts.sort_values(["sticky", "predicted", "cycled"], ascending=False, ignore_index=True)
