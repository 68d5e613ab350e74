"""Section of the report: accuracy of every detector along every axis of the grid."""

from simbench.bench.score.names import LEAST
from simbench.page.document import Part, Table, Text
from simbench.report.data import RunData

TITLE = "By axis"


def section(run: RunData) -> list[Part]:
    """List the scores by grid axis, one sortable table."""
    every = run.scores.by_axis
    here = every[every["role"] != "yardstick"]
    names = {
        "axis": "axis",
        "value": "value",
        "method": "detector",
        "n": "scenarios",
        "applicable": "applicable",
        "accuracy": "accuracy",
        "accuracy_lo": "from",
        "accuracy_hi": "to",
        "sensitivity": "sensitivity",
        "false_positives": "false positives",
        "no_decision": "no decision",
    }
    # a rate of few loops is chance
    enough = here["applicable"] >= LEAST
    kept = here.columns.isin(["axis", "value", "method", "n", "applicable"])
    here = here.where(enough.to_numpy()[:, None] | kept)
    digits = dict.fromkeys(
        ["accuracy", "from", "to", "sensitivity", "false positives", "no decision"], "{:.3f}".format
    )
    return [
        Text(
            "Accuracy at each value of each axis where the detector applies, against whether the"
            " loop cycled, with its 95 % interval. S_over_2J: 0 is a healthy valve, inf a pure"
            " dead-band."
        ),
        Table(here[list(names)].rename(columns=names), digits),
    ]
