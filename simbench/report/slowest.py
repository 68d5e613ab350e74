"""Section of the report: the computing time of each detector."""

import pandas as pd

from simbench.html.document import Part, Table, Text
from simbench.html.table import percent
from simbench.report.data import RunData

TITLE = "Slowest detectors"


def section(run: RunData) -> list[Part]:
    """List time per record and share of the whole, and the ten slowest single records."""
    ms = run.times
    if ms.isna().all(axis=None):
        return [Text("The times of these verdicts were not stored.")]
    cost = pd.DataFrame(
        {
            "method": ms.columns,
            "median (ms)": ms.median().to_numpy(),
            "95 % below (ms)": ms.quantile(0.95).to_numpy(),
            "slowest (ms)": ms.max().to_numpy(),
            "share of all": (ms.sum() / max(float(ms.to_numpy().sum()), 1e-12)).to_numpy(),
        }
    ).sort_values("share of all", ascending=False)
    ten = (
        ms.rename_axis(index="scenario", columns="method")
        .stack()
        .nlargest(10)
        .rename("time (ms)")
        .reset_index()
    )
    return [
        Text(
            "Time per record, measured while the run went on; the only numbers here that change"
            " from run to run."
        ),
        Table(cost, {"share of all": percent}),
        Text("Ten slowest records", "heading"),
        Table(ten),
    ]
