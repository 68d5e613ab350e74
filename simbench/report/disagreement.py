"""Section of the report: scenarios on which the labels (sticky, predicted, cycled) disagree."""

from markupsafe import Markup

from simbench.html.table import sortable
from simbench.report.data import REPORTED_TRUTHS, RunData
from simbench.report.page import render

TITLE = "Where the labels disagree"


def section(run: RunData) -> Markup:
    """Count the combinations of the labels: sticky, predicted (Table 11.3), refined (with its
    conditions), theory (the exact cycle) and cycled.
    """
    names = list(REPORTED_TRUTHS)
    words = run.truths.astype(object).where(run.truths.notna(), "-").astype(str)
    words = words.replace({"True": "yes", "False": "no"})
    counted = (
        words.groupby(names)
        .size()
        .rename("scenarios")
        .reset_index()
        .sort_values("scenarios", ascending=False)
    )
    agree = counted[names].nunique(axis=1) == 1
    counted.insert(0, "all agree", agree.map({True: "yes", False: "no"}))
    share = counted.loc[~agree, "scenarios"].sum() / max(len(words), 1)
    return render("disagreement.html", table=sortable(counted), share=share)
