"""Figure 11.18: half-cycle fits to OP of flow loop CHEM1 and to PV of level loop PAP3 (needs
ISDB).
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.judge import judge
from simbench.detectors.signal.conditioning import band
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.figures._fits import draw_fits, half_cycle_fits
from simbench.figures._marks import note
from simbench.figures._records import NeedsRecord, real_loop
from simbench.page.style import panels, styled

SOURCE = "Jelali (2013), Fig. 11.18 and Example 11.4; data: ISDB loops CHEM1, PAP3"
PRINTED = {
    "CHEM1": ("OP", "self-regulating", "flow", 0.83),
    "PAP3": ("PV", "integrating", "level", 0.70),
}


def data(isdb: str) -> pd.DataFrame:
    """Fit the loops that are there; CHEM1 is needed.

    Columns: loop, Ts (s), eta, eta_two_line (-), half (number), sample (index), signal, sine,
    triangle (record's units).
    """
    # Loops that are not there are left out, but for the first
    rows = []
    for name, (signal, process, kind, _) in PRINTED.items():
        try:
            record = real_loop(isdb, name, process=process, kind=kind)
        except NeedsRecord:
            if not rows:
                raise
            continue

        # The half cycles with both fits, and the printed index
        period = find_oscillation(record.op, record.pv, record.Ts).period_s / record.Ts
        fits = half_cycle_fits(band(record.op if signal == "OP" else record.pv, period, 7), period)
        indices = judge(record, ["he"], raw=True)[0].indices
        rows.append(
            fits.assign(
                loop=name, Ts=record.Ts, eta=indices["eta"], eta_two_line=indices["eta_two_line"]
            )
        )
    return pd.concat(rows, ignore_index=True)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw up to 16 half cycles of each loop with both fits."""
    # One panel a loop
    loops = list(data.groupby("loop", sort=False))
    figure, axes = panels(len(loops), 1, 7.2, 2.9 * len(loops))
    for place, (name, part) in zip(axes[:, 0], loops):
        signal, _, _, printed = PRINTED[str(name)]
        shown = part[part.half < part.half.min() + 16]
        draw_fits(
            place,
            shown,
            float(part.Ts.iloc[0]),
            signal,
            f"{signal} - drift (record's units)",
            str(name),
        )
        both = (
            f"η = {part.eta.iloc[0]:.2f}, with two free lines {part.eta_two_line.iloc[0]:.2f}"
            f" (printed: {printed:.2f})"
        )
        note(place, both, 0.99, 0.98, "right")
    return figure
