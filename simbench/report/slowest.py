"""Section of the report: the computing time of each detector."""

import pandas as pd
from markupsafe import Markup

from simbench.html.table import percent, sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Slowest detectors"


def section(run: RunData) -> Markup:
    """List time per record and share of the whole, and the ten slowest single records."""
    ms = run.times
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
    return render(
        "slowest.html", cost=sortable(cost, formats={"share of all": percent}), ten=sortable(ten)
    )
