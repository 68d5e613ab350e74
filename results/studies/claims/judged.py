"""The loops on which every claim is judged, and how answers about them are counted.

Recorded loops: one record of every loop of the folders whose label its contributor states or calls
likely. Echoes: pairs of a loop whose valve sticks and a healthy loop that the same motion drives
without the valve's corners; both members of a pair have the same rhythm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from results.studies.plant import echoes
from results.studies.plant.real_loops import read, share
from simbench.bench.statistics import auc
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import PROCESSES, LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION

YES, NO, CANNOT_TELL = 1, -1, 0
SAID = {STICTION: YES, NO_STICTION: NO, NO_DECISION: CANNOT_TELL}
HEAD = (
    "variant", "loops", "n", "sticky loops found", "others called sticky", "cannot tell",
    "balanced accuracy", "AUC (95 %)",
)  # fmt: skip


@dataclass(frozen=True)
class Loops:
    """Loops of which it is known whether the valve sticks."""

    name: str
    records: Sequence[LoopRecord]
    sticky: np.ndarray  # shape (n,)
    group: np.ndarray  # the contributor, or the pair; none is learned from and judged at once


@dataclass(frozen=True)
class Claim:
    """What was claimed, and how it is judged here; the last are what the publication leaves open
    and was chosen here.
    """

    claimed: str
    protocol: str
    stand_in: str
    rows: Callable[[Sequence[Loops]], list[tuple[str, ...]]]
    draw: Callable[[Path], None] | None = None


class Answers(NamedTuple):
    """What a detector says of each loop: a score that is larger where stiction is likelier, NaN
    where it has none, and YES, NO or CANNOT_TELL.
    """

    score: np.ndarray
    said: np.ndarray


def labelled(folders: Sequence[Path]) -> pd.DataFrame:
    """Return a row for the first record of every loop whose label is stated or likely and not
    doubted.
    """
    rows = read(folders)
    doubted = rows.label_doubt.notna() if "label_doubt" in rows else False
    return rows[
        (rows.usable == 1)
        & (rows.primary == 1)
        & (rows.label != "unknown")
        & (rows.tier != "unverified")
        & ~doubted
    ].drop_duplicates(["loop", "label"])


def recorded(folders: Sequence[Path]) -> Loops:
    """Return the labelled loops of folders."""
    rows = labelled(folders)
    sticky = (rows.label == STICTION).to_numpy()
    return Loops("recorded", records_of(rows), sticky, rows.contributor.to_numpy())


def records_of(rows: pd.DataFrame) -> list[LoopRecord]:
    """Return the records of rows, without MV."""
    records = []
    for row in rows.itertuples():
        process = str(row.dynamics).replace("_", "-")
        known = {"process": process} if process in PROCESSES else {}
        records.append(read_record(Path(row.folder) / f"{row.id}.csv", **known).without_mv())
    return records


def echoed(count: int, seed: int) -> Loops:
    """Return so many pairs of a sticky loop of grid chapter and an echo, drawn by the seed."""
    if count < 1:
        raise ParameterError(f"-n {count}: at least 1 pair is needed")
    members = list(echoes.pairs("chapter", count, seed))
    sticky = np.array([m.kind == echoes.STICKY for m in members])
    return Loops("echoes", [m.record for m in members], sticky, np.arange(len(members)) // 2)


def decided(score: np.ndarray, no: float, yes: float) -> Answers:
    """Return the answers of a rule with two thresholds: at most `no`, at least `yes`."""
    with np.errstate(invalid="ignore"):
        said = np.where(score >= yes, YES, np.where(score <= no, NO, CANNOT_TELL))
    return Answers(score, said)


def learned_threshold(score: np.ndarray, loops: Loops) -> Answers:
    """Return the answers of the rule "above a threshold" for each loop, whose threshold has the
    best balanced accuracy on the loops of all other groups.
    """
    said = np.zeros(score.size, dtype=int)
    for group in np.unique(loops.group):
        here = loops.group == group
        rest = ~here & np.isfinite(score)
        values = np.unique(score[rest])
        cuts = 0.5 * (values[1:] + values[:-1])
        above = score[rest, None] > cuts
        sticky = loops.sticky[rest]
        right = above[sticky].mean(axis=0) + (~above[~sticky]).mean(axis=0)
        best = cuts[int(right.argmax())]
        said[here] = np.where(np.isfinite(score[here]), np.where(score[here] > best, YES, NO), 0)
    return Answers(score, said)


def balanced_accuracy(answers: Answers, sticky: np.ndarray) -> float:
    """Return the mean of the shares of right answers among sticky loops and among others; no answer
    counts as half a right one, so that .5 is worth nothing.
    """
    right = (answers.said == np.where(sticky, YES, NO)) + 0.5 * (answers.said == CANNOT_TELL)
    return 0.5 * float(right[sticky].mean() + right[~sticky].mean())


def counted(variant: str, loops: Loops, answers: Answers) -> tuple[str, ...]:
    """Return one line of a claim's table, in the order of HEAD."""
    found, called = ((answers.said[loops.sticky == s] == YES).sum() for s in (True, False))
    return (
        variant,
        loops.name,
        str(loops.sticky.size),
        share(int(found), int(loops.sticky.sum())),
        share(int(called), int((~loops.sticky).sum())),
        str(int((answers.said == CANNOT_TELL).sum())),
        f"{balanced_accuracy(answers, loops.sticky):.2f}",
        area(answers.score, loops.sticky),
    )


def in_the_middle(score: np.ndarray) -> np.ndarray:
    """Return scores, shape (n,), with loops that have none in the middle of the others."""
    known = np.isfinite(score)
    return np.where(known, score, np.median(score[known]) if known.any() else 0.0)


def area(score: np.ndarray, sticky: np.ndarray) -> str:
    """Return the AUC with its interval; a loop without a score stands in the middle of the
    others.
    """
    if not np.isfinite(score).any():
        return "-"
    value = auc(in_the_middle(score), sticky)
    return f"{value.value:.2f} ({value.lo:.2f} to {value.hi:.2f})"
