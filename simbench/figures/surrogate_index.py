"""Surrogate index NPI: most sticky cycles stay below its bound, and linear oscillations driven by
noise may rise above it.

A strict cycle of any shape keeps its harmonics, and so its predictability, in every surrogate: NPI
near 0. A linear loop that noise makes oscillate wanders in amplitude, as do its surrogates, and by
chance predicts itself better or worse than they do.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.signal import lfilter

from simbench.detectors.signal.conditioning import drift
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.detectors.signal.surrogates import nonlinearity_index
from simbench.figures._loops import choudhury, pi_loop, sine
from simbench.figures._style import BLACK, BLUE, GREEN, GREY, RED, label, panel, styled
from simbench.loop.simulate import simulate

SOURCE = (
    "Thornhill (2005), IEEE Trans. Control Systems Technology 13, 434-443; Jelali (2013), Sect."
    " 11.6"
)
NOISE = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4)  # std over that of the oscillation
SEEDS = 12
N, PERIOD = 3000, 60.0
COLOURS = {
    "sticky valve": RED,
    "strict triangle": GREEN,
    "healthy, sine from outside": BLUE,
    "linear, driven by noise": BLACK,
}


def looped(kind: str, noise: float, seed: int) -> tuple[np.ndarray, float]:
    """Return the control error of a simulated loop, and its period in samples; NaN without one."""
    sticky = kind == "sticky valve"
    cause = {"valve": choudhury(5.0, 2.5)} if sticky else {"disturbance": sine(2.0, 80.0)}
    loop = pi_loop(
        T=20.0, Td=10.0, Kc=0.8, Ti=20.0, Ts=1.0, n=N, noise={"std": 1.4 * noise}, **cause
    )
    record = simulate(loop, seed, kick=8.0).record
    return record.e, find_oscillation(record.op, record.pv, 1.0).period_s


def made(kind: str, noise: float, seed: int) -> tuple[np.ndarray, float]:
    """Return a signal that needs no loop, and its period in samples."""
    rng = np.random.default_rng([seed, round(1000 * noise)])
    if kind == "strict triangle":
        x = np.abs((np.arange(N) % PERIOD) / (PERIOD / 4) - 2) - 1
    else:
        # two poles at the frequency, damped by 1/e in 500 samples
        x = lfilter(
            [1.0],
            [1.0, -2 * 0.998 * np.cos(2 * np.pi / PERIOD), 0.998**2],
            rng.standard_normal(2 * N),
        )[N:]
    return x + noise * x.std() * rng.standard_normal(N), PERIOD


def data() -> pd.DataFrame:
    """Return the index of oscillations that are linear and that are not, over the noise.

    Columns: kind, noise ratio (-), seed, npi (-); loops without a period are left out.
    """
    rows = []
    for kind in COLOURS:
        make = looped if kind in ("sticky valve", "healthy, sine from outside") else made
        for noise in NOISE:
            for seed in range(SEEDS):
                x, period = make(kind, noise, seed)
                if np.isfinite(period):
                    rows.append(
                        [kind, noise, seed, nonlinearity_index(x - drift(x, period), period).npi]
                    )
    return pd.DataFrame(rows, columns=["kind", "noise ratio (-)", "seed", "npi (-)"])


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw every index, side by side at each noise, and the published bound."""
    figure, axes = panel(6.6, 4.0)
    for j, (kind, colour) in enumerate(COLOURS.items()):
        part = data[data["kind"] == kind]
        place = part["noise ratio (-)"].map({x: i for i, x in enumerate(NOISE)}) + 0.18 * (j - 1.5)
        axes.plot(
            place,
            part["npi (-)"],
            "o",
            color=colour,
            markersize=3.5,
            markerfacecolor="none",
            label=kind,
        )
    axes.axhline(1.0, color=GREY, linestyle="--", linewidth=0.8)
    axes.text(-0.5, 1.03, "nonlinear above", color=GREY, va="bottom")
    axes.set_xticks(range(len(NOISE)), [f"{x:g}" for x in NOISE])
    label(axes, "noise over oscillation (std, -)", "NPI (-)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
    return figure
