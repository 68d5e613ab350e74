"""Score a run: every detector where it applies, by truth, oscillation detection, process and
population, and by axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from detectors.signal.conditioning import median
from detectors.verdict import NO_STICTION, STICTION
from scenarios.grid import grid_names
from scenarios.spec import read_toml
from simbench.bench.score.folds import folds_of, found_at, risk_coverage
from simbench.bench.score.names import (
    ALL,
    FRONT,
    NO_WAVEFORM,
    OF_NOT_OSCILLATING,
    OF_OSCILLATING,
    RAW,
    ROLE_YARDSTICK,
    kind_of,
)
from simbench.bench.score.no_waveform import no_waveform
from simbench.bench.score.quantification import quantification
from simbench.bench.score.ranks import RANKED_LOOPS, UNDECIDED, Ranks, rank_methods
from simbench.bench.score.result import Scores
from simbench.bench.score.stability import RankStability, stability
from simbench.bench.statistics import area, auc, dense_ranks, rate, wilson
from simbench.bench.store.reading import CODES, TRUTHS, RunArrays
from simbench.bench.store.tables import AXES

if TYPE_CHECKING:
    import pandas as pd

_PROCESSES = {ALL: None, "self-regulating": "foptd", "integrating": "integrating"}
# rates with Wilson intervals, in the order they are shown
_RATES = (
    "accuracy_applicable",
    "accuracy_decided",
    "no_decision",
    "found",
    "false_alarms",
    "accuracy_all",
)
_LEFT_OUT = ("entrained", "unclear")
_YARDSTICKS = {"always no": CODES[NO_STICTION], "always yes": CODES[STICTION]}
_COVERED = 0.95  # of a block's loops: a method made for fewer has no rank there


class _Answers(NamedTuple):
    """What one method said on all n scenarios of a run."""

    method: str
    role: str
    sees_mv: bool
    said: np.ndarray
    score: np.ndarray
    applies: np.ndarray
    failed: np.ndarray
    runtime: np.ndarray
    home: str = "no"


def score_run(
    folder: str | Path, raw: bool = False, undecided: float = UNDECIDED, allow_failed: float = 0.0
) -> Scores:
    """Score a finished run."""
    return score_book(RunArrays.read(folder), raw, undecided, allow_failed)


def score_book(
    book: RunArrays, raw: bool = False, undecided: float = UNDECIDED, allow_failed: float = 0.0
) -> Scores:
    """Score a run that is in memory; see `score_run`.

    A method that raised an error on more than `allow_failed` of its records has no rank.
    """
    rows, by_axis, left_out, first = [], [], [], RAW if raw else FRONT
    standing, stable = {}, {}
    blind, failing = no_waveform_answers(book), _failing(book, allow_failed)
    going = book.oscillating
    populations = {
        ALL: np.ones(going.size, dtype=bool),
        OF_OSCILLATING: going,
        OF_NOT_OSCILLATING: ~going,
    }
    # answers to an exam are scored as given
    for mode in (FRONT,) if "exam" in book.manifest else (FRONT, RAW):
        # the order of the scores is all that counts, and found once
        everyone = [
            a._replace(score=dense_ranks(a.score)) for a in (*answers_of(book, mode), blind)
        ]
        left_out += _left_out(book, mode, everyone)
        for truth in TRUTHS:
            for (process, name), (population, members) in product(
                _PROCESSES.items(), populations.items()
            ):
                here = members if name is None else members & (book.axes["process"] == name)
                place = {
                    "truth": truth,
                    "mode": mode,
                    "front_end": mode == FRONT,
                    "process": process,
                    "population": population,
                }
                block = _block(book, truth, here, place, blind)
                # where nothing oscillates no score tells loops apart
                found = [
                    _row(block, a, undecided, interval=population != OF_NOT_OSCILLATING)
                    for a in everyone
                ]
                standing[truth, mode, process, population], ranked = _rank(
                    block, everyone, found, undecided, failing
                )
                rows += found
                if (mode, process, population) == (first, ALL, OF_OSCILLATING):
                    stable[truth] = _stability(block, ranked, undecided, book)
        for axis in AXES:
            for value, chosen in axis_values(book, axis):
                place = {
                    "axis": axis,
                    "value": value,
                    "truth": "cycled",
                    "mode": mode,
                    "front_end": mode == FRONT,
                }
                block = _block(book, "cycled", chosen, place, blind)
                by_axis += [_row(block, a, undecided, interval=False) for a in everyone]
    frames = [_frame(part, {"axis": "", "value": "", **rows[0]}) for part in (rows, by_axis)]
    other = _disagreement(book), _frame(left_out, {}), quantification(book)
    counts = {"scenarios": int(book.ids.size), OF_OSCILLATING: int(book.oscillating.sum())}
    return Scores(
        *frames, *other, standing, book.manifest, counts, stable, failing, first, undecided
    )


def _failing(book: RunArrays, allowed: float) -> dict[str, int]:
    """Return on how many simulated records each method raised an error that raised more than is
    allowed.
    """
    simulated = book.hashes != b""
    counts = (book.failed & simulated).sum(axis=1)
    return {
        m: int(k)
        for m, k in zip(book.methods, counts, strict=True)
        if k > allowed * simulated.sum()
    }


def _frame(rows: list[dict[str, Any]], example: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    there = [r for r in rows if r["n"]]
    # where no loop has a truth, the table has its columns all the same
    return (
        pd.DataFrame(there) if there else pd.DataFrame(columns=list(rows[0] if rows else example))
    )


def answers_of(book: RunArrays, mode: str = FRONT) -> Iterator[_Answers]:
    """Yield what every method of a run said, and two yardsticks that always say the same."""
    verdicts, scores = (
        (book.verdict, book.score) if mode == FRONT else (book.verdict_raw, book.score_raw)
    )
    for i, method in enumerate(book.methods):
        about = book.manifest["methods"][method]
        applies = book.applicable[i] != 0
        yield _Answers(
            method,
            about["role"],
            about["needs_mv"],
            verdicts[i],
            scores[i],
            applies,
            book.failed[i],
            book.runtime[i],
            home_of(method, book),
        )
    nothing = np.zeros(book.ids.size)
    for name, code in _YARDSTICKS.items():
        said = np.full(book.ids.size, code)
        yield _Answers(
            name, ROLE_YARDSTICK, False, said, nothing, nothing == 0, nothing != 0, nothing
        )


def home_of(method: str, book: RunArrays) -> str:
    """Return whether a method's constants were fitted to this grid ("fitted here"), to one with the
    same blocks, or "no".
    """
    known = [
        name
        for name in book.manifest["methods"][method].get("fitted_on", ())
        if name in grid_names()
    ]
    if book.manifest["grid"] in known:
        return "fitted here"
    return "siblings" if any(_blocks(name) & set(book.axes["block"]) for name in known) else "no"


@cache
def _blocks(grid: str) -> frozenset[str]:
    # as the file names them: building a grid only to ask for names takes longer than the scoring
    table = read_toml(Path(str(files("scenarios") / "grids" / f"{grid}.toml")))
    return frozenset(block["name"] for block in table.get("block", ()))


_classified: WeakKeyDictionary[RunArrays, _Answers] = WeakKeyDictionary()


def no_waveform_answers(book: RunArrays) -> _Answers:
    """Return what a classifier answers of an oscillating loop from everything but its waveform,
    learned on other groups.

    It is trained once for a run in memory.
    """
    if book not in _classified:
        (chance, verdicts), nothing = no_waveform(book), np.zeros(book.ids.size)
        _classified[book] = _Answers(
            NO_WAVEFORM,
            ROLE_YARDSTICK,
            False,
            verdicts,
            chance,
            nothing == 0,
            nothing != 0,
            nothing,
        )
    return _classified[book]


def axis_values(book: RunArrays, axis: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield every value of an axis as text, in order, with the scenarios that have it."""
    values = book.axes[axis]
    if values.dtype.kind == "f":
        for value in np.unique(values[~np.isnan(values)]):
            yield f"{value:g}", values == value
    else:
        for value in np.unique(values[values != ""]):
            yield str(value), values == value


class _Block(NamedTuple):
    """The loops of one row: how many, which have the truth asked for; of these which are positive,
    in what group and fold.

    `blind` is what the classifier that knows no waveform says of these.
    """

    place: dict[str, Any]
    size: int
    use: np.ndarray
    positive: np.ndarray
    groups: np.ndarray
    folds: np.ndarray
    blind: np.ndarray


def _block(
    book: RunArrays, truth: str, chosen: np.ndarray, place: dict[str, Any], blind: _Answers
) -> _Block:
    use = np.flatnonzero(chosen & (book.truth[truth] >= 0))
    positive, groups = (
        book.truth[truth][use] == 1,
        np.unique(book.groups[use], return_inverse=True)[1],
    )
    return _Block(
        place, int(chosen.sum()), use, positive, groups, folds_of(groups), blind.said[use]
    )


def _row(block: _Block, a: _Answers, cost: float, interval: bool = True) -> dict[str, Any]:
    use, applies, positive = block.use, a.applies[block.use], block.positive
    here, groups, folds, blind = use, block.groups, block.folds, block.blind
    if not applies.all():
        here, positive, groups, folds, blind = (
            x[applies] for x in (use, positive, groups, folds, blind)
        )
    said = a.said[here]
    n, m, p, right = use.size, said.size, int(positive.sum()), int((said == positive).sum())
    undecided = int((said == CODES["no_decision"]).sum())
    yes = said == CODES[STICTION]
    found = int((yes & positive).sum())
    # where a method does not apply it does not decide: nothing right is added
    of = (
        (right, m),
        (right, m - undecided),
        (undecided, m),
        (found, p),
        (int(yes.sum()) - found, m - p),
        (right, n),
    )
    row: dict[str, Any] = {
        "method": a.method,
        **block.place,
        "role": a.role,
        "sees_mv": a.sees_mv,
        "home": a.home,
    }
    row.update(n=n, n_all=block.size, positives=int(block.positive.sum()), applicable=m)
    lo, hi = (bound.tolist() for bound in wilson(*zip(*of, strict=True)))
    for name, (hits, trials), *ends in zip(_RATES, of, lo, hi, strict=True):
        row[name] = hits / trials if trials else math.nan
        row[f"{name}_lo"], row[f"{name}_hi"] = ends
    earned = _earned(said, positive, cost)
    row["cost"], row["cost_lo"], row["cost_hi"] = _mean_of_groups(1.0 - earned, groups)
    score = a.score[here]
    if interval:
        over = _mean_of_groups(_earned(blind, positive, cost) - earned, groups, -1.0)
        (
            row["cost_over_no_waveform"],
            row["cost_over_no_waveform_lo"],
            row["cost_over_no_waveform_hi"],
        ) = over
        ends = rate(found_at(score, positive, folds), p) if 0 < p < m else rate(0, 0)
        row["found_at_5"], row["found_at_5_lo"], row["found_at_5_hi"] = ends
        ends = _mean_of_groups(risk_coverage(score, positive, folds)[1], groups)
        row["risk_coverage"], row["risk_coverage_lo"], row["risk_coverage_hi"] = ends
    if not (known := score >= 0).all():
        score, positive = score[known], positive[known]
    row["scored"] = score.size
    if interval:
        row["auc"], row["auc_lo"], row["auc_hi"] = auc(score, positive)
    else:
        row["auc"] = area(score, positive)
    row["errors"] = int(a.failed[use].sum())
    row["median_ms"] = round(1e3 * median(a.runtime[use]), 4) if n else math.nan
    return row


def _earned(said: np.ndarray, positive: np.ndarray, cost: float) -> np.ndarray:
    """Return 1 where right, 0 where wrong, and 1 less its cost where nothing was decided."""
    return np.where(said == CODES["no_decision"], 1.0 - cost, said == positive)


def _mean_of_groups(
    values: np.ndarray, groups: np.ndarray, least: float = 0.0
) -> tuple[float, float, float]:
    """Return a mean of values from `least` to 1 with its 95 % interval; values of one group hang
    together.
    """
    if not values.size:
        return math.nan, least, 1.0
    mean = float(values.mean())
    shares = np.bincount(groups, values - mean)
    # one value of 0 and one of 1 added: few loops that all cost the same do not show the cost
    # exactly
    size = values.size + 2
    alone = (float(values @ values) + 1.0) / size - ((float(values.sum()) + 1.0) / size) ** 2
    variance = max(float(shares @ shares) / values.size, alone)
    half = 1.96 * math.sqrt(variance / values.size)
    return mean, max(mean - half, least), min(mean + half, 1.0)


def _left_out(book: RunArrays, mode: str, everyone: list[_Answers]) -> list[dict[str, Any]]:
    """Count what every method says of loops that no score against `cycled` holds, and of those it
    does not apply to.
    """
    rows = []
    for a in everyone:
        known = book.truth["cycled"] >= 0
        kinds = {word: (book.truth["cycled_word"] == word) & a.applies for word in _LEFT_OUT}
        for of, chosen in {**kinds, "does not apply": known & ~a.applies}.items():
            n = int(chosen.sum())
            row: dict[str, Any] = {
                "method": a.method,
                "mode": mode,
                "role": a.role,
                "of": of,
                "n": n,
            }
            for word, code in CODES.items():
                said = int((a.said[chosen] == code).sum())
                row[word] = said / n if n else math.nan
                row[f"{word}_lo"], row[f"{word}_hi"] = map(float, wilson(said, n))
            rows.append(row)
    return rows


def _rank(
    block: _Block,
    everyone: list[_Answers],
    rows: list[dict[str, Any]],
    cost: float,
    failing: dict[str, int],
) -> tuple[Ranks, list[_Answers]]:
    """Write a rank into each row of a block, and return what it can resolve with the methods ranked
    together.

    Methods with MV are ranked among themselves. No rank have reference rows, methods made for a
    part of the loops, methods that failed too often, and anyone where too few loops have a label.
    """
    use, standing, enough = block.use, [], block.use.size >= RANKED_LOOPS
    for row in rows:
        row["rank"] = math.nan
    for kind in (0, 1):
        mine = [
            k
            for k, a in enumerate(everyone)
            if kind_of(a.role, a.sees_mv) == kind and a.method not in failing
        ]
        # a rank compares methods on the same loops
        members = [k for k in mine if enough and rows[k]["applicable"] >= _COVERED * rows[k]["n"]]
        earned = [
            _earned(everyone[k].said[use], block.positive, cost) * everyone[k].applies[use]
            for k in members
        ]
        ranks = rank_methods(np.reshape(earned, (len(members), use.size)), block.groups)
        for k, rank in zip(members, ranks.rank, strict=True):
            rows[k]["rank"] = int(rank)
        standing.append((ranks, [everyone[k] for k in members]))
    return standing[0] if standing[0][1] else standing[1]


def _stability(
    block: _Block, ranked: Sequence[_Answers], cost: float, book: RunArrays
) -> RankStability:
    """Return how stable the order of the ranked methods is, with halves drawn from the run's
    seed.
    """
    use = block.use
    earned = {a.method: _earned(a.said[use], block.positive, cost) * a.applies[use] for a in ranked}
    right = {a.method: a.said[use] == block.positive for a in ranked}
    return stability(earned, right, block.groups, int(book.manifest.get("seed") or 0))


def _disagreement(book: RunArrays) -> pd.DataFrame:
    import pandas as pd

    def word(codes: np.ndarray) -> np.ndarray:
        return np.array(["no cell", "no", "yes"])[codes + 1]

    said = {"sticky": word(book.truth["sticky"]), "predicted": word(book.truth["predicted"])}
    frame = pd.DataFrame({**said, "cycled": book.truth["cycled_word"]})
    counts = frame.value_counts(sort=False).rename("scenarios").reset_index()
    return counts.sort_values(["sticky", "predicted", "cycled"], ascending=False, ignore_index=True)
