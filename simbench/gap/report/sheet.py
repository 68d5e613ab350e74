"""One picture of a diagnosis: the record, its simulation without and with the effect, which effect, how far it helps."""

from __future__ import annotations

from matplotlib.figure import Figure

from simbench.figures._style import label, mosaic, styled
from simbench.gap.report.pictures import RECORD, fill_gap, fill_ranking, fill_traces
from simbench.gap.report.result import GapReport, words
from simbench.gap.report.traces import gap_sizes, recorded, simulated, window

SAMPLES = 400  # of the record's end: a few periods of most loops
SHOWN = 5  # candidates


@styled
def draw_sheet(report: GapReport) -> Figure:
    """Draw record and simulations over time at the left, probabilities and gap at the right.

    Parameters
    ----------
    report : GapReport
        Of `diagnose`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    runs = {RECORD: recorded(report), **simulated(report)}
    layout = [[name, "which" if 2 * i < len(runs) else "gap"] for i, name in enumerate(runs)]
    figure, axes = mosaic(layout, 9.0, 1.2 + 0.95 * len(runs), width_ratios=[1.5, 1.0])
    fill_traces([axes[name] for name in runs], "PV", runs, *window(report, SAMPLES))
    for name in list(runs)[:-1]:
        axes[name].tick_params(labelbottom=False)
    top = [r for r in report.ranking if r.probability >= 0.005][:SHOWN]
    fill_ranking(axes["which"], [words(r.effect) for r in top], [r.probability for r in top])
    fill_gap(axes["gap"], gap_sizes(report))
    label(axes["which"], "probability", "", "what is missing")
    label(axes["gap"], "distance from the record\n(seed-to-seed standard deviations)", "", "gap between simulation and record")
    return figure
