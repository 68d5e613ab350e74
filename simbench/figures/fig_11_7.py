"""Figure 11.7: friction force against velocity: Coulomb, with viscous, with stiction, and Stribeck
friction.

The forces are those of the physical valve models' published actuator; the Stribeck part lives below
1 mm/s.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._marks import note, parts
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.page.style import BLUE, GREY, RED, label, panels, styled

SOURCE = (
    "Jelali (2013), Fig. 11.7, after Olsson et al. (1998); numbers: Choudhury et al. (2005),"
    " Table 1"
)


def data() -> pd.DataFrame:
    """Evaluate the four static friction laws at the published parameters.

    Columns: panel, velocity (mm/s), friction (N); three rows at velocity 0 (-, at rest, +) where
    the law jumps.
    """
    # Each law over the speed that shows it
    p = valve_parameters(VALVES.load("stribeck"), {}, 1.0)
    wide = np.linspace(0.0, 600.0, 61)
    narrow = np.linspace(0.0, 1.5, 151)
    laws = {
        "(a) Coulomb": (wide, p.Fc + 0.0 * wide, p.Fc),
        "(b) Coulomb + viscous": (wide, p.Fc + p.Fv * wide / 1000, p.Fc),
        "(c) stiction + Coulomb + viscous": (wide, p.Fc + p.Fv * wide / 1000, p.Fs),
        "(d) Stribeck": (
            narrow,
            p.Fc + (p.Fs - p.Fc) * np.exp(-((narrow / 1000 / p.vs) ** 2)) + p.Fv * narrow / 1000,
            p.Fs,
        ),
    }

    # Both signs of the speed, with the break-away force at rest
    rows = []
    for panel, (v, force, at_rest) in laws.items():
        both = np.concatenate([-v[::-1], [0.0, 0.0], v])
        friction = np.concatenate([-force[::-1], [-at_rest, at_rest], force])
        rows.append(
            pd.DataFrame({"panel": panel, "velocity (mm/s)": both, "friction (N)": friction})
        )
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw force over velocity, at rest in another colour."""
    # Moving in blue, at rest in red
    figure, axes = panels(2, 2, 6.4, 5.4)
    for place, panel, part in parts(axes, data, "panel"):
        v = part["velocity (mm/s)"].to_numpy()
        force = part["friction (N)"].to_numpy()
        place.axhline(0, color=GREY, linewidth=0.6)
        moving = v.size // 2 - 1
        place.plot(v[:moving], force[:moving], color=BLUE, linewidth=1.8, label="moving")
        place.plot(v[moving + 2 :], force[moving + 2 :], color=BLUE, linewidth=1.8)
        place.plot(
            [0, 0], force[moving : moving + 2], color=RED, linewidth=1.8, label="at rest: up to"
        )
        place.set_ylim(-2000, 2000)
        label(place, "velocity (mm/s)", "friction force (N)", str(panel))
        note(place, f"break-away {force[moving + 1]:.0f} N", 0.03, 0.97)
    axes[0, 0].legend(loc="lower right")
    return figure
