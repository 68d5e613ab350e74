"""Section of the report: detectors that raised an exception, scenarios that could not be simulated,
and why methods gave no decision.
"""

import re

from simbench.page.document import Part, Table, Text
from simbench.report.data import RunData

TITLE = "Failures and abstentions"
_ROWS_SHOWN = 50  # rows shown


def section(run: RunData) -> list[Part]:
    """List errors, and count the reasons of "no decision" with their numbers taken out."""
    errors = run.errors
    reasons = run.abstentions.assign(why=run.abstentions["reason"].map(_pattern))
    why = reasons.groupby(["method", "why"]).size().rename("verdicts").reset_index()
    why = why.sort_values("verdicts", ascending=False).head(_ROWS_SHOWN)
    parts: list[Part] = [Text("No detector raised, every scenario ran.", "good")]
    if len(errors):
        shown = Table(errors.head(_ROWS_SHOWN), long=["error"])
        parts = [Text(f"{len(errors)} failures.", "bad"), shown]
    if len(why):
        parts += [Text("Why methods abstained", "heading"), Table(why, long=["why"])]
    return parts


def _pattern(reason: str) -> str:
    """Return a reason with its numbers as `#`, so that like reasons count together."""
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", reason)
