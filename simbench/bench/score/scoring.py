"""Score a run: every detector where it applies, by truth, process and population, and by axis."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from simbench.bench.score.answers import (
    RATES,
    Answers,
    answers_of,
    axis_codes,
    counted,
    failing_methods,
    long_table,
    reference_answers,
    share_frame,
    share_of,
    tallied,
    with_names,
)
from simbench.bench.score.names import ALL, OF_NOT_OSCILLATING, OF_OSCILLATING, SAMPLED, kind_of
from simbench.bench.score.no_waveform import folds_of, found_at, sample_of
from simbench.bench.score.quantification import quantification
from simbench.bench.score.ranks import RANKED_LOOPS, UNDECIDED, Ranks, rank_methods
from simbench.bench.score.result import Scores
from simbench.bench.score.shipped import read_joined, with_shipped
from simbench.bench.statistics import area, auc, dense_ranks, rate
from simbench.bench.store.reading import CODES, TRUTHS, RunArrays
from simbench.detectors.signal.conditioning import median
from simbench.scenarios.cell import ULTIMATE

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

# numbers of the processes, and of whether a loop oscillates, that each holds
_PROCESSES = {ALL: (0, 1, 2), "self-regulating": (0,), "integrating": (1,)}
_RESTING = (0,)
_KEY = ("truth", "process", "population")  # of a block of the table
_POPULATIONS = {ALL: (0, 1, 2), OF_OSCILLATING: (1,), OF_NOT_OSCILLATING: _RESTING}
_LEFT_OUT = ("entrained", "unclear")
_EACH = ("said", "applies", "failed", "runtime")
# columns of a row: what its method is, and what is counted
_ABOUT = ("role", "sees_mv", "home", "division", "name", "answered", "own")
_COUNTED = [
    *("n", "n_all", "positives", "applicable"),
    *(f"{rate}{end}" for rate in RATES for end in ("", "_lo", "_hi")),
]
_UNKNOWN = -1  # in place of the code of an answer that is not known
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
    import pandas as pd

    book = with_shipped(book).without_copies()
    reference = reference_answers(book)
    failing = failing_methods(book, allow_failed)
    everyone = list(answers_of(book)) + reference
    answers = long_table(everyone)

    # what the classifier says is not known where a run was stored without what it sees
    if reference:
        blind = reference[0].said
    else:
        blind = np.full(book.ids.size, _UNKNOWN)
    sample = _Sample.of(book, everyone, blind)
    process = np.select([book.axes["process"] == x for x in ("foptd", "integrating")], [0, 1], 2)

    # 0 does not oscillate, 1 does, 2 is not ranked
    going_on = np.where(book.apart, 2, book.oscillating)
    labels = {truth: book.truth[truth] for truth in TRUTHS}
    blocks = list(product(TRUTHS, _PROCESSES, _POPULATIONS))
    cube = counted(answers, process=process, going_on=going_on, **labels)
    counts = tallied(pd.concat(_counts_of_block(cube, *key) for key in blocks), [*_KEY, "method"])
    rows = []
    standing = {}
    for key in blocks:
        truth, kind, population = key
        of = _PROCESSES[kind]
        going = _POPULATIONS[population]
        block = sample.block(np.isin(process, of) & np.isin(going_on, going), labels[truth])
        # where nothing oscillates no score tells loops apart
        each = _of_each(counts, key, len(everyone))
        found = _score_block(block, sample, each, zip(_KEY, key), undecided, going != _RESTING)
        standing[key] = _write_ranks(block, sample.answers, found, undecided, failing)
        rows += found
    by_axis = list(_by_axis(book, answers, sample, undecided)) or [
        {"axis": "", "value": "", **rows[0]}
    ]
    frames = [_frame_of_rows(rows), _frame_of_rows(by_axis)]
    other = (
        _count_disagreements(book),
        _count_left_out(book, answers, everyone),
        _count_by_cause(book, answers, everyone),
        quantification(book),
    )
    sizes = {"scenarios": int(book.ids.size), OF_OSCILLATING: int((going_on == 1).sum())}
    if sample.some.size < book.ids.size:
        sizes[SAMPLED] = sample.some.size
    return Scores(*frames, *other, standing, book.manifest, sizes, failing, undecided, book)


def _counts_of_block(cube: pd.DataFrame, truth: str, kind: str, population: str) -> pd.DataFrame:
    """Return the counts of one block of the table, by the label asked for."""
    there = cube["process"].isin(_PROCESSES[kind])
    there &= cube["going_on"].isin(_POPULATIONS[population])
    about = {"truth": truth, "process": kind, "population": population}
    return cube.assign(label=cube[truth])[there].assign(**about)


def _of_each(counts: pd.DataFrame, key: Any, methods: int) -> list[dict[str, Any]]:
    """Return what `tallied` says of every method of one group; zeros of one without loops."""
    if key in counts.index:
        return counts.loc[key].to_dict("records")
    return [dict.fromkeys(counts.columns, 0)] * methods


def _frame_of_rows(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return rows as a table, without those of no loop."""
    import pandas as pd

    table = pd.DataFrame(rows)
    return table.loc[table["n"] > 0].reset_index(drop=True)


class _Sample(NamedTuple):
    """The loops on which orders and spreads are worked out, of a large run a part of all, and what
    every method said of them; `blind` is the classifier that knows no waveform.
    """

    some: np.ndarray
    groups: np.ndarray
    answers: list[Answers]
    blind: np.ndarray

    @classmethod
    def of(cls, book: RunArrays, everyone: Sequence[Answers], blind: np.ndarray) -> _Sample:
        some = np.sort(sample_of(book.groups))
        # the order of the scores is all that counts, and found once
        answers = []
        for a in everyone:
            answers.append(
                a._replace(
                    score=dense_ranks(a.score[some]), **{x: getattr(a, x)[some] for x in _EACH}
                )
            )
        return cls(some, book.groups[some], answers, blind[some])

    def block(self, chosen: np.ndarray, label: np.ndarray) -> _Block:
        """Return the chosen loops of a run that have a label."""
        chosen = chosen[self.some]
        label = label[self.some]
        use = np.flatnonzero(chosen & (label >= 0))
        groups = np.unique(self.groups[use], return_inverse=True)[1]
        return _Block(use, label[use] == 1, groups, folds_of(groups), self.blind[use])


class _Block(NamedTuple):
    """The loops of one block of a table that have the truth asked for: which are positive, in what
    group and fold, and what the classifier that knows no waveform says of them.
    """

    use: np.ndarray
    positive: np.ndarray
    groups: np.ndarray
    folds: np.ndarray
    blind: np.ndarray


def _score_block(
    block: _Block,
    sample: _Sample,
    counts: Sequence[dict[str, Any]],
    place: Iterable[tuple[str, str]],
    cost: float,
    interval: bool = True,
) -> list[dict[str, Any]]:
    """Return a row for every method: what is a count, of all loops (`counts` are `tallied`); orders
    and spreads, of those in the block.
    """
    # What is counted
    where = dict(place)
    rows = []
    for a, c in zip(sample.answers, counts, strict=True):
        row: dict[str, Any] = {"method": a.method, **where}
        row |= {key: getattr(a, key) for key in _ABOUT} | {key: c[key] for key in _COUNTED}

        # Of loops that the method covers, by the truth
        row["missed"] = _divide_counts(c["missed"], c["sticky"])
        row["no_decision_positives"] = _divide_counts(c["open_sticky"], c["sticky"])
        row["no_decision_negatives"] = _divide_counts(
            c["open_other"], c["applicable"] - c["sticky"]
        )
        wrong = c["applicable"] - c["right"] - (1.0 - cost) * c["open"]
        of_all = _divide_counts(wrong, c["applicable"]), c["applicable"]

        # What needs an order, and the time
        row |= _score_orders(block, a, cost, of_all, interval)
        row["errors"] = c["errors"]
        times = a.runtime[block.use]
        if times.size:
            row["median_ms"] = round(1e3 * median(times), 4)
        else:
            row["median_ms"] = math.nan
        rows.append(row)
    return rows


def _divide_counts(part: float, whole: int) -> float:
    if whole:
        return part / whole
    return math.nan


def _score_orders(
    block: _Block, a: Answers, cost: float, of_all: tuple[float, int], interval: bool
) -> dict[str, float]:
    """Return what needs an order of the loops or their spread; `of_all` are the mean cost of all
    loops, and how many the method covers.
    """
    # The loops that the method covers
    applies = a.applies[block.use]
    if applies.all():
        here, positive, groups, folds, blind = block
    else:
        here, positive, groups, folds, blind = (x[applies] for x in block)

    # The mean cost, its interval by groups of loops
    earned = _earn_answers(a.said[here], positive, cost)
    ranges = {"cost": _mean_of_groups(1.0 - earned, groups, 0.0, *of_all)}
    score = a.score[here]

    # Sensitivity at 5 % false positives, and cost over the row without a waveform
    if interval:
        sticky = int(positive.sum())
        both = 0 < sticky < positive.size
        if both:
            found = rate(found_at(score, positive, folds), sticky)
        else:
            found = rate(0, 0)
        ranges |= {
            "cost_over_no_waveform": _mean_of_groups(
                _earn_answers(blind, positive, cost) - earned, groups, -1.0
            ),
            "sensitivity_at_5": found,
        }

    # The area under the ROC curve, of loops with a score
    if not (known := score >= 0).all():
        score = score[known]
        positive = positive[known]

    # Each range as three columns
    row: dict[str, float] = {}
    for name, ends in ranges.items():
        row[name], row[f"{name}_lo"], row[f"{name}_hi"] = ends
    row["scored"] = score.size
    if not interval:
        return row | {"auc": area(score, positive)}
    return row | dict(zip(("auc", "auc_lo", "auc_hi"), auc(score, positive), strict=True))


def _earn_answers(said: np.ndarray, positive: np.ndarray, cost: float) -> np.ndarray:
    """Return 1 where right, 0 where wrong, 1 less its cost where nothing was decided, and NaN where
    it is not known what was said.
    """
    earned = np.where(said == CODES["no_decision"], 1.0 - cost, said == positive)
    return np.where(said == _UNKNOWN, math.nan, earned)


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
    if of_all is None:
        n = values.size
    else:
        mean = of_all
    half = 1.96 * math.sqrt(variance / n)
    return mean, max(mean - half, least), min(mean + half, 1.0)


def _by_axis(
    book: RunArrays, answers: pa.Table, sample: _Sample, cost: float
) -> Iterator[dict[str, Any]]:
    """Yield rows against `cycled` for every value of every axis of a run."""
    label = book.truth["cycled"]
    for axis in book.along:
        values, codes = axis_codes(book, axis)
        counts = tallied(counted(answers, code=codes, label=label), ["code", "method"])
        for k, value in enumerate(values):
            place = {"axis": axis, "value": value, "truth": "cycled"}.items()
            block = sample.block(codes == k, label)
            each = _of_each(counts, k, len(sample.answers))
            yield from _score_block(block, sample, each, place, cost, interval=False)


def _count_left_out(
    book: RunArrays, answers: pa.Table, everyone: Sequence[Answers]
) -> pd.DataFrame:
    """Count what every method says of loops that no score against `cycled` holds, and of those it
    does not apply to.
    """
    import pandas as pd

    words = [book.truth["cycled_word"] == word for word in _LEFT_OUT]
    kind = np.select(words + [book.truth["cycled"] >= 0], [0, 1, 2], 3)
    counts = counted(answers, of=kind)

    # the last of the three: with a truth, and not covered
    counts = counts[(counts["of"] < 3) & (counts["applies"] == (counts["of"] < 2))]
    by = counts.pivot_table("count", ["method", "of"], "said", "sum", fill_value=0)
    by = by.reindex(columns=CODES.values(), fill_value=0)
    n = by.sum(axis=1)
    shares = [share_frame(word, by[code], n) for word, code in CODES.items()]
    table = pd.concat([n.rename("n")] + shares, axis=1).reset_index()
    table["of"] = np.array([*_LEFT_OUT, "does not apply"], dtype=object)[table["of"]]
    return with_names(table, everyone, "role")


def _count_by_cause(
    book: RunArrays, answers: pa.Table, everyone: Sequence[Answers]
) -> pd.DataFrame:
    """Count how often every method calls loops sticky that the valve does not make cycle, by what
    makes them oscillate.
    """
    import pandas as pd

    # What makes each loop oscillate, the echoes by their kind
    texts, places = axis_codes(book, "echo")
    kinds = np.array(texts + [""])[places]
    echoes = [kind for kind in dict.fromkeys(kinds) if kind not in ("", "none")]
    causes = np.array(
        [f"echo, {kind}" for kind in echoes] + ["own tuning", "no oscillation", "other"], object
    )
    place = np.select(
        [(book.truth["cycled"] != 0) | (book.apart & ~np.isnan(book.axes["cut"]))]
        + [kinds == kind for kind in echoes]
        + [np.isin(book.axes["tuning"].astype(str), list(ULTIMATE)), ~book.oscillating],
        [len(causes), *range(len(causes) - 1)],
        len(causes) - 1,
    )

    # False positives and no decision by cause
    counts = counted(answers, cause=place, label=book.truth["cycled"])
    of = tallied(counts[(counts["cause"] < len(causes)) & counts["applies"]], ["method", "cause"])
    parts = (
        of["applicable"].rename("n"),
        share_frame("false_positives", of["alarms"], of["applicable"]),
        share_of(of["open_other"], of["applicable"]).rename("no_decision"),
    )
    table = pd.concat(parts, axis=1).reset_index()
    table["cause"] = causes[table["cause"]]
    return with_names(table, everyone, "role")


def _write_ranks(
    block: _Block,
    everyone: list[Answers],
    rows: list[dict[str, Any]],
    cost: float,
    failing: dict[str, int],
) -> Ranks:
    """Write a rank into each row of a block, and return what it can resolve.

    Methods with MV are ranked among themselves. No rank have reference rows, methods that answer a
    part of the loops, methods that failed too often, and anyone where too few loops have a label. A
    method of whoever ran the grid always has one: where it answers a part of the loops, among those
    that answer these.
    """
    # No rank to begin with
    standing = []
    n = rows[0]["n"]
    for row in rows:
        row["rank"] = math.nan
        row["rank_loops"] = 0

    # Methods without MV by themselves, those with MV by themselves
    for kind in (0, 1):
        mine = []
        for k, a in enumerate(everyone):
            if kind_of(a.role, a.sees_mv) == kind and a.method not in failing:
                mine.append(k)
        # a rank compares methods on the same loops
        members = [k for k in mine if n >= RANKED_LOOPS and rows[k]["applicable"] >= _COVERED * n]
        earned = {}
        for k in mine:
            earned[k] = _earnings_with_gaps(block, everyone[k], cost)
        means = [1.0 - rows[k]["cost"] for k in members]
        ranks = rank_methods(
            np.reshape([earned[k] for k in members], (len(members), block.use.size)),
            block.groups,
            np.array(means),
            n,
        )
        for k, rank in zip(members, ranks.rank, strict=True):
            rows[k]["rank"] = int(rank)
            rows[k]["rank_loops"] = n
        standing.append((ranks, members))
        for k in (k for k in mine if everyone[k].own and k not in members):
            if rows[k]["applicable"] >= RANKED_LOOPS:
                rows[k]["rank"] = _rank_where_it_answers(block, everyone, earned, k)
                rows[k]["rank_loops"] = rows[k]["applicable"]

    # What the ranks of those without MV can resolve, or else of the others
    without_mv, with_mv = standing
    return (without_mv if without_mv[1] else with_mv)[0]


def _earnings_with_gaps(block: _Block, a: Answers, cost: float) -> np.ndarray:
    """Return what a method earns on each loop of a block: where it does not answer, what it earns
    elsewhere, so that a gap neither helps nor harms it.
    """
    earned = _earn_answers(a.said[block.use], block.positive, cost)
    applies = a.applies[block.use]
    return np.where(applies, earned, earned[applies].mean() if applies.any() else 0.0)


def _rank_where_it_answers(
    block: _Block, everyone: list[Answers], earned: Mapping[int, np.ndarray], own: int
) -> int:
    """Return the rank of a method among those that answer the loops that it answers."""
    here = everyone[own].applies[block.use]
    peers = []
    for k in earned:
        if everyone[k].applies[block.use][here].mean() >= _COVERED:
            peers.append(k)
    ranks = rank_methods(np.array([earned[k][here] for k in peers]), block.groups[here])
    return int(ranks.rank[peers.index(own)])


def _count_disagreements(book: RunArrays) -> pd.DataFrame:
    import pandas as pd

    def word(codes: np.ndarray) -> np.ndarray:
        return np.array(["no cell", "no", "yes"])[codes + 1]

    said = {"sticky": word(book.truth["sticky"]), "predicted": word(book.truth["predicted"])}
    frame = pd.DataFrame({**said, "cycled": book.truth["cycled_word"]})
    counts = frame.value_counts(sort=False).rename("scenarios").reset_index()
    return counts.sort_values(["sticky", "predicted", "cycled"], ascending=False, ignore_index=True)
