"""Table 11.2: typical shapes of OP and PV under a sticky valve, checked by the shape classifier on
simulated cycles.

Four loops per cell, J/S from 0.2 to 1; every cycle gets one of four labels (square, triangle,
saw-tooth, sine) by dynamic time warping. A saw-tooth counts as a triangle, and a parabola, whose
label does not exist, as a sine.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.methods.srinivasan import SHAPES, cycles, label_shares
from simbench.figures._cycles import sustained_cycle
from simbench.figures._loops import choudhury, pi_loop
from simbench.page.style import SIGNAL, label, panels, styled
from simbench.theory.tables import TABLE_11_2

SOURCE = "Jelali (2013), Table 11.2, after Forsman (2000) and Srinivasan et al. (2005a)"
S = 5.0
PHASE = np.linspace(0.0, 2.0, 201)  # where the drawn waves are read, in periods
FAST = {"K": 1.0, "T": 1.0, "Td": 0.5, "Ts": 0.25}
SLOW = {"K": 1.0, "T": 60.0, "Td": 12.0, "Ts": 2.0}
LEVEL = {"K": 0.01, "Td": 10.0, "Ts": 1.0}
# plant and Ts (s), controller, and J (%) of the four valves
LOOPS = {
    ("fast (flow)", "I"): ({**FAST, "Kc": 0.05, "Ti": 0.5}, (1.0, 2.0, 3.5, 5.0)),
    ("fast (flow)", "P"): ({**FAST, "Kc": 0.8, "Ti": 100.0}, (4.4, 4.6, 4.8, 5.0)),
    ("slow (pressure, temperature)", ""): (
        {**SLOW, "Kc": 2.0, "Ti": 60.0},
        (1.0, 1.5, 2.0, 2.5),
    ),
    ("integrating (level)", "P"): ({**LEVEL, "Kc": 5.0, "Ti": None}, (2.0, 3.0, 4.0, 5.0)),
    ("integrating (level)", "PI"): ({**LEVEL, "Kc": 3.0, "Ti": 60.0}, (1.0, 2.0, 3.5, 5.0)),
}
COUNTS_AS = {
    "square": {"square"}, "rectangular": {"square"}, "sinusoidal": {"sine"}, "parabolic": {"sine"},
    "triangular (sharp)": {"triangle", "sawtooth"}, "triangular (smooth)": {"triangle"},
}  # fmt: skip


def data() -> pd.DataFrame:
    """Simulate four loops per cell, label their cycles and keep two periods of the second loop for
    the picture.

    Columns: process, action, signal, table (shape), drawn (what most cycles of the drawn loop look
    like), agreement (-, share of the cycles of all loops with the table's label), cycles, t/P (-),
    value (mean removed, largest 1).
    """
    # Three slip jumps in every cell of the table
    rows = []
    for (process, action), shapes in TABLE_11_2.items():
        settings, jumps = LOOPS[process, action]
        waves = {"OP": [], "PV": []}
        wave = {}
        for J in jumps:
            cycle = sustained_cycle(pi_loop(**settings, valve=choudhury(S, J)), periods=12)
            period = cycle["period (s)"].iloc[0] / settings["Ts"]
            for signal, column in (("OP", "OP (%)"), ("PV", "PV - SP")):
                x = cycle[column].to_numpy() - cycle[column].mean()
                waves[signal].append(cycles(x, period))
                if J == jumps[1]:
                    wave[signal] = np.interp(PHASE * period, np.arange(x.size), x / np.abs(x).max())

        # How many cycles have the table's shape
        for signal, shape in zip(("OP", "PV"), shapes):
            every = np.concatenate(waves[signal])
            seen = dict(zip(SHAPES, label_shares(waves[signal][1]), strict=True))
            agreement = sum(
                share
                for name, share in zip(SHAPES, label_shares(every))
                if name in COUNTS_AS[shape]
            )

            # Two periods of the second one are drawn
            frame = pd.DataFrame({"t/P (-)": PHASE, "value (-)": wave[signal]})
            about = {"process": process, "action": action, "signal": signal, "table": shape}
            about["drawn"] = max(seen, key=lambda name: seen[name])
            rows.append(frame.assign(**about, agreement=agreement, cycles=len(every)))
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw one waveform per cell with the table's word and the agreement."""
    # One panel for every cell
    figure, axes = panels(2, len(TABLE_11_2), 10.4, 4.6, sharex=True, sharey=True)
    for j, (process, action) in enumerate(TABLE_11_2):
        part = data[(data["process"] == process) & (data["action"] == action)]
        for i, (signal, wave) in enumerate(part.groupby("signal", sort=False)):
            place = axes[i, j]
            place.plot(wave["t/P (-)"], wave["value (-)"], color=SIGNAL[str(signal)])
            first = wave.iloc[0]
            word = (
                f"{signal}, table: {first['table']}\n({first['agreement']:.0%} of"
                f" {first['cycles']} cycles)\nnearest shape: {first['drawn']}"
            )
            place.set_title(word, fontsize=7.5)
            place.set_ylim(-1.15, 1.15)
            label(place, "time / period" if i else "", f"{signal} (scaled)" if j == 0 else "")

        # The cell's words above it
        head = process.replace(" (", "\n(") + (f", {action} action" if action else "")
        axes[0, j].text(
            0.0,
            1.5,
            head,
            transform=axes[0, j].transAxes,
            fontweight="bold",
            va="bottom",
            fontsize=8.5,
        )
    return figure
