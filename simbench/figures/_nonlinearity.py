"""Draw control error, bicoherence and PV-OP plot of one recorded loop, with and without
filtering.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.bicoherence import bicoherence
from simbench.detectors.signal.ellipse import fit_ellipse
from simbench.figures._ellipses import ellipse_points
from simbench.figures._marks import mosaic, note
from simbench.page.style import BLUE, GREY, RED, label

_SEGMENT = 64


def nonlinearity(record: LoopRecord, op: np.ndarray, pv: np.ndarray) -> pd.DataFrame:
    """Return trend, bicoherence, PV-OP plot and fitted ellipse in long form."""
    # The control error of a record that is long enough
    if record.n < 4 * _SEGMENT:
        raise RecordError(
            f"{record.tag}: {record.n} samples; at least {4 * _SEGMENT} are needed for a"
            " bicoherence"
        )
    if record.sp is None:
        e = -pv
    else:
        e = record.sp - pv

    # Its bicoherence, and PV over OP
    higher = bicoherence(e, _SEGMENT)
    rows = [
        pd.DataFrame({"part": "error", "t (s)": record.t, "e": e}),
        pd.DataFrame(
            {"part": "bicoherence", "f1": higher.f1, "f2": higher.f2, "bic2 (-)": higher.bic2}
        ),
        pd.DataFrame({"part": "data", "OP": op, "PV": pv}),
    ]

    # The fitted ellipse, where there is one
    fitted = fit_ellipse(op, pv)
    about = {"NGI (-)": higher.ngi, "NLI (-)": higher.nli}
    if fitted is not None:
        x, y = ellipse_points(fitted)
        rows.append(pd.DataFrame({"part": "ellipse", "OP": x, "PV": y}))
        about |= {"fitness (-)": fitted.fitness(op, pv), "S_apparent": fitted.apparent_stiction}
    return pd.concat(rows, ignore_index=True).assign(**about)


def draw_nonlinearity(data: pd.DataFrame, ellipse: bool, printed: str) -> Figure:
    """Draw the three views side by side."""
    # The error over time
    figure, axes = mosaic([["error", "bic", "xy"]], 9.0, 3.2)
    error = data[data.part == "error"]
    higher = data[data.part == "bicoherence"]
    points = data[data.part == "data"]
    axes["error"].plot(error["t (s)"], error["e"], color=BLUE, linewidth=0.7)
    label(axes["error"], "time (s)", "SP - PV (record's units)", "control error")

    # Its bicoherence over both frequencies
    shades = axes["bic"].scatter(
        higher["f1"],
        higher["f2"],
        c=higher["bic2 (-)"],
        s=13,
        marker="s",
        cmap="cividis",
        vmin=0,
        vmax=1,
    )
    figure.colorbar(shades, ax=axes["bic"], label="squared bicoherence (-)")
    label(axes["bic"], "f1 (cycles/sample)", "f2 (cycles/sample)", "nonlinearity")
    axes["bic"].set_ylim(0, 0.31)

    # PV over OP with the ellipse
    axes["xy"].margins(y=0.22)
    first = data.iloc[0]
    note(axes["bic"], f"NGI = {first['NGI (-)']:.3f}, NLI = {first['NLI (-)']:.2f}\n{printed}")
    axes["xy"].plot(points["OP"], points["PV"], color=GREY, linewidth=0.4, marker=".", markersize=2)
    if ellipse and (data.part == "ellipse").any():
        ring = data[data.part == "ellipse"]
        axes["xy"].plot(ring["OP"], ring["PV"], color=RED, linewidth=1.6)
        note(
            axes["xy"],
            f"apparent stiction {first['S_apparent']:.2g}\nfitness {first['fitness (-)']:.0%}",
        )
    label(axes["xy"], "OP (record's units)", "PV (record's units)", "PV-OP plot")
    return figure
