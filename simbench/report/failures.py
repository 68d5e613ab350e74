"""Section of the report: detectors that raised an exception, scenarios that could not be simulated,
and why methods gave no decision.
"""

import re

from markupsafe import Markup

from simbench.html.table import sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Failures and abstentions"
_ROWS_SHOWN = 50  # rows shown


def section(run: RunData) -> Markup:
    """List errors, and count the reasons of "no decision" with their numbers taken out."""
    errors = run.errors
    reasons = run.abstentions.assign(why=run.abstentions["reason"].map(_pattern))
    why = reasons.groupby(["method", "why"]).size().rename("verdicts").reset_index()
    why = why.sort_values("verdicts", ascending=False).head(_ROWS_SHOWN)
    return render(
        "failures.html",
        count=len(errors),
        errors=sortable(errors.head(_ROWS_SHOWN), long=["error"]),
        why=sortable(why, long=["why"]),
    )


def _pattern(reason: str) -> str:
    """Return a reason with its numbers as `#`, so that like reasons count together."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", reason)
