"""Section: accuracy of every detector against every axis of the grid."""

from __future__ import annotations

from markupsafe import Markup

from simbench.html.table import sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "By axis"


def section(run: RunData) -> Markup:
    """List the scores by grid axis, one sortable table.

    Parameters
    ----------
    run : RunData
        The run.

    Returns
    -------
    markupsafe.Markup
    """
    every = run.scores.by_axis
    here = every[every["mode"] == run.scores.first]
    table = here[
        ["axis", "value", "method", "n", "accuracy", "accuracy_lo", "accuracy_hi", "false_alarm", "miss", "no_decision"]
    ]
    names = {"method": "detector", "accuracy": "right", "accuracy_lo": "from", "accuracy_hi": "to", "n": "scenarios"}
    names |= {"false_alarm": "false alarms", "miss": "misses", "no_decision": "undecided"}
    digits = dict.fromkeys(["right", "from", "to", "false alarms", "misses", "undecided"], "{:.3f}".format)
    return render("axes.html", table=sortable(table.rename(columns=names), formats=digits))
