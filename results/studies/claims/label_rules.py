"""Rules that labelled the data of learned detectors, judged as detectors themselves.

A network that learns the labels of a rule answers, at best, as the rule does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from results.studies.claims.judged import (
    CANNOT_TELL,
    NO,
    SAID,
    YES,
    Answers,
    Claim,
    Loops,
    counted,
)  # fmt: skip
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord

WIDTH, RATIO = 6, 15.0  # samples of a window and slope ratio: Damarla et al. 2022


def slope_ratio_share(record: LoopRecord) -> float:
    """Return the share of windows in which OP is steeper than PV by the published ratio."""
    t = np.arange(WIDTH) - 0.5 * (WIDTH - 1)
    n = record.n // WIDTH * WIDTH
    of_op, of_pv = (np.abs(x[:n].reshape(-1, WIDTH) @ t) for x in (record.op, record.pv))
    return float(np.mean(of_op >= RATIO * of_pv) if n else np.nan)


def standardised(record: LoopRecord) -> LoopRecord:
    """Return the record with OP and PV of standard deviation 1."""
    op, pv = ((x - x.mean()) / (x.std() or 1.0) for x in (record.op, record.pv))
    return replace(record, op=op, pv=pv)


def both_agree(record: LoopRecord) -> tuple[float, int]:
    """Return what ellipse and Kano's method A, with PV in place of the valve position, say
    together: a label only where they agree.
    """
    with_pv = replace(record, mv=record.pv)
    verdicts = judge(with_pv, ["ellipse", "kano_a"])
    said = {SAID[v.verdict] for v in verdicts}
    scores = [v.score for v in verdicts]
    return float(np.mean(scores)), said.pop() if len(said) == 1 else CANNOT_TELL


def rows(data: Sequence[Loops]) -> list[tuple[str, ...]]:
    """Return a line for each rule."""
    table = []
    for loops in data:
        for name, records in (
            ("as recorded", loops.records),
            ("standardised", [standardised(record) for record in loops.records]),
        ):
            shares = np.array([slope_ratio_share(record) for record in records])
            answers = Answers(shares, np.where(shares > 0.0, YES, NO))
            table.append(counted(f"slope ratio, {name}", loops, answers))
        scores, said = zip(*(both_agree(record) for record in loops.records))
        answers = Answers(np.array(scores), np.array(said))
        table.append(counted("ellipse and Kano, both", loops, answers))
    return table


CLAIM = Claim(
    claimed=(
        "networks learn stiction from labels that a rule gave: an LSTM .74 (N. Promsricha et al."
        " 2026, arXiv 2601.12362) from slope ratios (S.K. Damarla et al. 2022, Ind. Eng. Chem. Res."
        " 61, 502); a random forest from ellipse and Kano where both agree"
    ),
    protocol="whole record; sticky where the slope ratio of any window is above its bound",
    stand_in=(
        "window (6) and ratio (15) of a public implementation; Kano's method A with PV in place of"
        " the valve position"
    ),
    rows=rows,
)
