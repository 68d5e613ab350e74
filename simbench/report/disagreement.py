"""Section of the report: scenarios on which the labels (sticky, predicted, cycled) disagree."""

from simbench.html.document import Part, Table, Text
from simbench.report.data import REPORTED_TRUTHS, RunData

TITLE = "Where the labels disagree"


def section(run: RunData) -> list[Part]:
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
    return [
        Text(
            "The five truths of a scenario, stored apart: friction in the valve (sticky), Table"
            " 11.3 (predicted), the table with its existence conditions (refined), a cycle by"
            " theory, and what the continued simulation did (cycled). They differ on"
            f" {100 * share:.1f} % of the scenarios."
        ),
        Table(counted),
    ]
