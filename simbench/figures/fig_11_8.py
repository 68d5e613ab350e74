"""Figure 11.8: Nyquist curve of a PI loop and -1/N of stick-slip and dead-band: self-regulating
(left), integrating (right).

Where the curves meet, the describing function predicts a limit cycle; a pure dead-band meets the
integrating loop only. The prediction is qualitative: OP is a triangle, and periods are off by up to
40 %.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._loops import COLUMNS, Loops
from simbench.figures._marks import parts
from simbench.page.style import BLACK, BLUE, GREY, ORANGE, RED, label, panels, styled
from simbench.scenarios.spec import Loop
from simbench.theory.describing import intersections, stiction
from simbench.theory.sampled import sampled_loop

SOURCE = (
    "Jelali (2013), Fig. 11.8 and Eqs 11.1 and 11.2 (signs restored), after Choudhury et al. (2005)"
)
S = 5.0
Ts = 0.1
JUMPS = (5.0, 2.0, 0.0)
COLOURS = (RED, ORANGE, BLUE)
PLANTS = {
    "(a) self-regulating": {"K": 1.0, "T": 10.0, "Td": 2.0, "Kc": 1.0, "Ti": 10.0},
    "(b) integrating": {"K": 0.1, "Td": 1.0, "Kc": 1.5, "Ti": 30.0},
}


def loop(panel: str, J: float, loops: Loops | None = None) -> Loop:
    """Return one panel's loop with a Choudhury valve of slip jump J."""
    return (loops or Loops()).pi(numbers={**PLANTS[panel], "Ts": Ts, "S": S, "J": J})


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Compute the curves and where they meet.

    Columns: panel, curve ("L", "-1/N" or "intersection"), J (%), Re (-), Im (-), w (rad/s), A (%),
    period (s), and the numbers of the loop.
    """
    # The open loop over frequency
    rows = []
    loops = loops or Loops()
    for panel in PLANTS:
        sampled = sampled_loop(loop(panel, 1.0, loops))
        own = {}
        for k, v in loops.last.items():
            if k != COLUMNS["J"]:
                own[k] = v
        w = np.geomspace(0.02, 0.9 * np.pi / Ts, 400)
        L = sampled.response(w)
        rows.append(
            pd.DataFrame(
                {"panel": panel, "curve": "L", "Re": L.real, "Im": L.imag, "w (rad/s)": w, **own}
            )
        )

        # Each slip jump: -1/N, and where it meets the loop
        for jump in JUMPS:
            found = sampled_loop(loop(panel, jump, loops))
            band, J = (loops.last[COLUMNS[name]] for name in "SJ")
            valve = stiction(band, J)
            A = valve.low * (1 + np.geomspace(1e-4, 100, 300))
            z = valve.critical(A)
            place = {"panel": panel, "J (%)": J, **own}
            curve = {"curve": "-1/N", "Re": z.real, "Im": z.imag, "A (%)": A}
            rows.append(pd.DataFrame(place | curve))
            for balance in intersections(found, valve):
                at = complex(valve.critical(balance.amplitude))
                mark = {
                    "curve": "intersection",
                    "Re": at.real,
                    "Im": at.imag,
                    "w (rad/s)": 2 * np.pi / balance.period,
                    "A (%)": balance.amplitude,
                    "period (s)": balance.period,
                }
                rows.append(pd.DataFrame([place | mark]))
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw both planes with the predicted periods and amplitudes."""
    # The open loop
    figure, axes = panels(1, 2, 8.0, 4.6, sharey=True)
    for place, panel, part in parts(axes, data, "panel"):
        place.axhline(0, color=GREY, linewidth=0.6)
        place.axvline(0, color=GREY, linewidth=0.6)
        L = part[part.curve == "L"]
        place.plot(L["Re"], L["Im"], color=BLACK, label="open loop $L(j\\omega)$")

        # Each slip jump with its predictions
        jumps = sorted(part["J (%)"].dropna().unique(), reverse=True)
        for J, colour in zip(jumps, COLOURS, strict=False):
            curve = part[(part.curve == "-1/N") & (part["J (%)"] == J)]
            if J:
                name = f"-1/N, J = {J:g} %"
            else:
                name = "-1/N, dead-band (J = 0)"
            place.plot(
                curve["Re"],
                curve["Im"],
                color=colour,
                linestyle="--" if J == 0 else "-",
                label=name,
            )
            for mark in part[(part.curve == "intersection") & (part["J (%)"] == J)].to_dict(
                "records"
            ):
                place.plot(
                    mark["Re"], mark["Im"], "o", color=colour, markeredgecolor="black", zorder=4
                )
                text = f"P = {mark['period (s)']:.0f} s\nA = {mark['A (%)']:.2f} %"
                line = {"arrowstyle": "-", "color": GREY, "linewidth": 0.6}
                place.annotate(
                    text,
                    (mark["Re"], mark["Im"]),
                    (0.25, mark["Im"]),
                    va="center",
                    fontsize=8,
                    arrowprops=line,
                )

        # The critical point and the axes
        place.plot(-1, 0, "+", color="black", markersize=7)
        place.set(xlim=(-3.6, 1.8), ylim=(-4.2, 0.5))
        label(place, "real part (-)", "imaginary part (-)", str(panel))
        place.label_outer()

    # One legend for both planes
    said = "period P and amplitude A of OP by the describing function, not exact"
    named = axes[0, 0].get_legend_handles_labels()
    figure.legend(*named, loc="outside lower center", ncols=4, title=said)
    return figure
