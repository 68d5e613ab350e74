"""Draw the sine and the triangle that the detector `he` fits to half cycles, on the time axis of
the record.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from simbench.detectors.signal.half_cycles import GUARD, HALF_CYCLE_POINTS, sines, triangles
from simbench.detectors.signal.oscillation import zero_crossings
from simbench.figures._marks import room
from simbench.page.style import BLACK, BLUE, RED, label


def half_cycle_fits(x: np.ndarray, period: float) -> pd.DataFrame:
    """Fit a sine and a triangle to every significant half cycle.

    The same cut, families and least squares as `simbench.detectors.signal.half_cycles`, kept in
    place and sign.
    """
    # Half cycles that are neither a ripple nor a period
    at = zero_crossings(x, GUARD * float(x.std()))
    rows = []
    for half, (start, length) in enumerate(zip(at[:-1], np.diff(at))):
        if not 0.125 * period < length < period:
            continue

        # The best sine and the best triangle at even places
        sample = start + length * (np.arange(HALF_CYCLE_POINTS) + 0.5) / HALF_CYCLE_POINTS
        hump = np.interp(sample, np.arange(x.size), x)
        fits = {}
        for name, family in (("sine", sines()), ("triangle", triangles())):
            heights = family @ hump
            best = int(np.argmax(np.abs(heights)))
            fits[name] = heights[best] * family[best]
        rows.append(pd.DataFrame({"half": half, "sample": sample, "signal": hump, **fits}))
    return pd.concat(rows, ignore_index=True)


def eta(fits: pd.DataFrame) -> float:
    """Return He's index of drawn fits, MSE_sine / (MSE_sine + MSE_triangle)."""
    sine = ((fits["signal"] - fits["sine"]) ** 2).mean()
    triangle = ((fits["signal"] - fits["triangle"]) ** 2).mean()
    return float(sine / (sine + triangle))


def draw_fits(axes: Axes, fits: pd.DataFrame, Ts: float, name: str, unit: str, title: str) -> None:
    """Draw a signal with both fits, half cycle by half cycle, against time in seconds."""
    start = fits["sample"].min()
    for half, part in fits.groupby("half"):
        t = (part["sample"] - start) * Ts
        first = half == fits["half"].min()
        axes.plot(
            t, part["signal"], ".", color=BLACK, markersize=2.5, label=name if first else None
        )
        axes.plot(t, part["sine"], color=BLUE, linestyle="--", label="sine" if first else None)
        axes.plot(t, part["triangle"], color=RED, label="triangle" if first else None)
    room(axes, fits["signal"], 0.08, 0.42)
    axes.legend(ncols=3, loc="upper left")
    label(axes, "time (s)", unit, title)
