"""Draw a diagnosis on one sheet: the record, simulations without and with the effect,
probabilities, and the gap.
"""

from __future__ import annotations

from matplotlib.figure import Figure

from simbench.gap.report.pictures import fill_gap, fill_ranking, fill_traces
from simbench.gap.report.ranked import LEAST_SHOWN, words
from simbench.gap.report.result import GapReport
from simbench.gap.report.traces import compared, end_of, gap_sizes
from simbench.page.style import label, styled

_SAMPLES = 400  # of the record's end: a few periods of most loops
_MOST = 5  # candidates: as many as fit beside the traces


@styled
def draw_sheet(report: GapReport) -> Figure:
    """Draw record and simulations over time at the left, probabilities and gap at the right."""
    traces = compared(report)
    figure = Figure(figsize=(9.0, 1.2 + 0.95 * len(traces)), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.5, 1.0], squeeze=False)[0]
    end = end_of(report.behind.found.situation, _SAMPLES)
    fill_traces(left.subplots(len(traces), 1, sharex=True, squeeze=False)[:, 0], "PV", traces, end)
    which, gap = right.subplots(2, 1)
    top = [r for r in report.ranking if r.probability >= LEAST_SHOWN][:_MOST]
    fill_ranking(which, {words(r.effect): r.probability for r in top})
    fill_gap(gap, gap_sizes(report))
    label(which, "probability", "", "what is missing")
    label(
        gap,
        "distance from the record\n(seed-to-seed standard deviations)",
        "",
        "gap between simulation and record",
    )
    return figure
