"""GB/T 44693.2-2024, F.2: PV over OP is a line when the valve follows, and opens to an ellipse when
it sticks.

The standard itself was not available. The rule is the one that open implementations of its
simplified calculation state: an ellipse by principal components of PV and OP, each in shares of its
range, b its short and a its long axis.
Needs: PV and OP, either process type, an oscillation, 100 samples.
Parameters: `ratio_low` (-), where these implementations begin to call stiction severe and to name
it; `line_low` (-), 0 as in the clause, 0.5 in a later implementation, which answers nothing for
points that have no clear long axis.
Indices: axis_ratio in 0..1 (b / a: 0 for a line, 1 for a circle), line_fit in 0..1 (squared
correlation of PV and OP).
Rule: axis_ratio > 0.3: stiction; else none; line_fit below its bound: no decision. The same sources
call 0.05 to 0.15 mild and 0.15 to 0.3 moderate.
Not for: deciding alone. The axis ratio measures the phase between OP and PV, which any controller
with integral action, any lag and any dead time makes as well: of simulated self-regulating loops it
finds seven in ten that cycle, and accuses nearly half of the healthy ones that oscillate.
Source: GB/T 44693.2-2024, clause F.2, by open implementations (St = b/a, levels at 5, 15 and 30 %),
read in 2026.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="axis ratio of the ellipse that PV draws over OP",
    source="GB/T 44693.2-2024, F.2, as open implementations have it",
    min_samples=100,
    thresholds={
        "ratio_low": Threshold(
            0.3, "-", 0.0, 1.0, "open implementations of F.2: severe", "above: stiction"
        ),
        "line_low": Threshold(
            0.0,
            "-",
            0.0,
            1.0,
            "F.2; 0.5 in a later implementation",
            "below: no long axis, no decision",
        ),
    },
)


def axis_ratio(x: np.ndarray, y: np.ndarray) -> float:
    """Return the short over the long axis of the points: principal components of x and y in shares
    of their ranges.
    """
    spread = np.linalg.eigvalsh(np.cov(x / np.ptp(x), y / np.ptp(y)))
    return float(np.sqrt(max(spread[0], 0.0) / spread[1]))


def detect(prepared: Prepared, *, ratio_low: float, line_low: float) -> Verdict:
    """Judge a record by how far the ellipse of PV over OP opens.

    Parameters
    ----------
    prepared : Prepared
        The record.
    ratio_low : float
        Bound of the axis ratio (-).
    line_low : float
        Least squared correlation of PV and OP (-).

    Returns
    -------
    Verdict
        `score` is the axis ratio.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> detect(Prepared(LoopRecord(np.sin(t), np.sin(t - 0.7), 0.1)), **METHOD.defaults()).verdict
    'stiction'
    """
    # A signal that stands still has no ellipse
    op = prepared.record.op
    pv = prepared.record.pv
    if np.ptp(op) == 0.0 or np.ptp(pv) == 0.0:
        return Verdict("gbt44693", NO_DECISION, reason="OP or PV does not move")

    # Axes of the ellipse, and how well a line fits
    ratio = axis_ratio(op, pv)
    fit = float(np.corrcoef(op, pv)[0, 1] ** 2)
    indices = {"axis_ratio": ratio, "line_fit": fit}
    numbers = f"short over long axis {ratio:.2f}, squared correlation of PV and OP {fit:.2f}"

    # No long axis, no answer; else an open ellipse means stiction
    if fit < line_low:
        return Verdict(
            "gbt44693",
            NO_DECISION,
            ratio,
            indices,
            reason=f"PV over OP has no long axis: {numbers}",
        )
    if ratio > ratio_low:
        return Verdict(
            "gbt44693",
            STICTION,
            ratio,
            indices,
            reason=f"PV over OP draws an open ellipse: {numbers}",
        )
    return Verdict(
        "gbt44693", NO_STICTION, ratio, indices, reason=f"PV over OP is close to a line: {numbers}"
    )
