"""OP-MV signature of every valve model: the picture by which each is recognised."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._style import BLUE, GREY, panels, styled
from simbench.loop.parameters import VALVES, Choice
from simbench.loop.response import valve_response

SOURCE = "this project's valve models, each with its own source"
# What a model takes of these it gets, % of travel and s; the rest keeps its default.
WANTED = {
    "S": 20.0,
    "J": 8.0,
    "S_up": 24.0,
    "J_up": 8.0,
    "S_down": 12.0,
    "J_down": 4.0,
    "D": 20.0,
    "d": 8.0,
    "H": 10.0,
    "R": 20.0,
    "T": 10.0,
    "low": 20.0,
    "high": 80.0,
    "period": 300.0,
    "on": 150.0,
    "S_end": 4.0,
    "J_end": 1.0,
    "t_end": 700.0,
}
Ts = 1.25  # s


def data() -> pd.DataFrame:
    """Drive every valve model by the same fading triangle.

    Columns: model, t (s), OP (%), MV (%).
    """
    corners = [50, 85, 15, 80, 25, 70, 40, 60]
    op = np.interp(np.arange(560), np.arange(len(corners)) * 80.0, corners)
    rows = []
    for model in VALVES.names():
        schema = VALVES.load(model).PARAMETERS
        chosen: dict[str, float | str] = {k: WANTED[k] for k in schema if k in WANTED}
        chosen |= {k: v.names[-1] for k, v in schema.items() if isinstance(v, Choice)}
        mv = valve_response(model, op, chosen, Ts)
        signals = {"t (s)": np.arange(op.size) * Ts, "OP (%)": op, "MV (%)": mv}
        rows.append(pd.DataFrame({"model": model, **signals}))
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw one OP-MV plot per model."""
    models = list(dict.fromkeys(data.model))
    columns = 7
    rows = -(-len(models) // columns)
    figure, axes = panels(rows, columns, 11.0, 1.65 * rows + 0.4, sharex=True, sharey=True)
    for place, model in zip(axes.flat, models):
        one = data[data.model == model]
        place.plot([0, 100], [0, 100], color=GREY, linestyle=":", linewidth=0.8)
        place.plot(one["OP (%)"], one["MV (%)"], color=BLUE, linewidth=1.0)
        place.set(title=model, aspect="equal", xlim=(5, 95), ylim=(5, 95))
    for place in axes.flat[len(models) :]:
        place.set_axis_off()
    figure.supxlabel("OP (% of span)", fontsize=8.5)
    figure.supylabel("MV (% of travel)", fontsize=8.5)
    return figure
