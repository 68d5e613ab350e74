"""He's sine against triangle, fitted to five cycles of the autocorrelation as one public monitor of
control loops does it: with the right sine, and with the one in its source, sin(k / pi).

The half cycle of sin(k / pi) is pi^2 = 9.87 samples long, whatever the loop's period. And the
autocorrelation of a triangle wave has its harmonics squared: it is nearly a sine.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from results.studies.claims.judged import Claim, Loops, counted, decided
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.autocorrelation import acf
from simbench.page.style import BLUE, GREY, ORANGE, label, panels, styled, write_picture

LOW, HIGH = 0.4, 0.6  # of the index, He 2007
CYCLES, FEWEST = 5, 4  # cycles of the autocorrelation, and fewest half cycles
REGULAR = 1.0  # least mean over three standard deviations of the half cycles' lengths
RIGHT, PRINTED = "right sine", "sin(k / pi)"
_SAMPLES = np.arange(6, 81, 2) + 0.37  # of a half cycle, in the picture; no whole number


def autocorrelation(x: np.ndarray) -> np.ndarray:
    """Return the autocorrelation at lags from 0 to half the signal's length."""
    return acf(x - x.mean())


def half_cycles(r: np.ndarray) -> list[np.ndarray]:
    """Return the half cycles of the first five cycles after the first fall below zero, turned
    upwards.
    """
    at = np.flatnonzero(np.diff(r >= 0.0)) + 1
    return [np.abs(r[a:b]) for a, b in pairwise(at[: 2 * CYCLES + 1])]


def regular(halves: Sequence[np.ndarray]) -> bool:
    """Return whether there are enough half cycles and their lengths vary little."""
    lengths = np.array([h.size for h in halves])
    spread = float(lengths.std(ddof=1)) if lengths.size > 1 else 0.0
    return lengths.size >= FEWEST and lengths.mean() > 3.0 * REGULAR * spread


def triangle_error(y: np.ndarray) -> float:
    """Return the least mean squared error of two lines from the first and the last sample to an
    apex.
    """
    n, errors = y.size, []
    for apex in range(1, n - 1):
        rise, fall = np.arange(apex + 1), np.arange(apex, n) - (n - 1)
        left, right = y[: apex + 1] - y[0], y[apex:] - y[-1]
        up, down = (t @ v / (t @ t) for t, v in ((rise, left), (fall, right)))
        errors.append(np.mean(np.concatenate([left - up * rise, right - down * fall]) ** 2))
    return min(errors)


def sine_error(y: np.ndarray, sine: str) -> float:
    """Return the mean squared error of the best multiple of a sine; the monitor's is fitted to the
    half cycle over its maximum.
    """
    k = np.arange(y.size)
    if sine == RIGHT:
        shape = np.sin(np.pi * k / (y.size - 1))
        return float(np.mean((y - (shape @ y) / (shape @ shape) * shape) ** 2))
    shape = np.sin(k / np.pi)
    return float(np.mean((y - (shape @ (y / y.max())) / (shape @ shape) * shape) ** 2))


def index(r: np.ndarray, sine: str) -> float:
    """Return MSE_sine / (MSE_sine + MSE_triangle) of an autocorrelation, or of a signal; NaN where
    the gates close.
    """
    halves = [h for h in half_cycles(r) if h.size > 3]
    if not regular(halves):
        return float("nan")
    sines = np.mean([sine_error(h, sine) for h in halves])
    triangles = np.mean([triangle_error(h) for h in halves])
    return float(sines / (sines + triangles)) if sines + triangles > 0.0 else 0.5


def control_error(record: LoopRecord) -> np.ndarray:
    """Return what the monitor looks at."""
    return -record.pv if record.sp is None else record.sp - record.pv


def first_integrating(record: LoopRecord) -> np.ndarray:
    """Return what He looks at: OP, or PV of an integrating process."""
    return record.pv if prepare(record).integrating else record.op


def rows(data: Sequence[Loops]) -> list[tuple[str, ...]]:
    """Return a line for each signal and sine."""
    signals = {"control error": control_error, "OP, or PV": first_integrating}
    table = []
    for loops in data:
        for name, seen in signals.items():
            lags = [autocorrelation(seen(record)) for record in loops.records]
            for sine in (RIGHT, PRINTED):
                found = np.array([index(r, sine) for r in lags])
                table.append(counted(f"{name}, {sine}", loops, decided(found, LOW, HIGH)))
    return table


@styled
def draw(path: Path) -> None:
    """Draw the index of a pure sine and of a pure triangle wave over the samples of their half
    cycle: of the signal itself, of its autocorrelation, and by the sine in the monitor's source.
    """
    figure, axes = panels(1, 3, 6.0, 2.4, sharey=True)
    waves = {"triangle wave": lambda t: np.arcsin(np.sin(t)), "sine": np.sin}
    ways = {
        "the signal": (np.asarray, RIGHT),
        "its autocorrelation": (autocorrelation, RIGHT),
        f"the same, {PRINTED}": (autocorrelation, PRINTED),
    }
    for ax, (title, (seen, sine)) in zip(axes.ravel(), ways.items()):
        for (name, wave), style in zip(waves.items(), ((BLUE, "-"), (ORANGE, "--"))):
            signals = [wave(np.pi * (np.arange(int(24 * n)) + 0.5) / n) for n in _SAMPLES]
            shown = [index(seen(x), sine) for x in signals]
            ax.plot(_SAMPLES, shown, style[1], color=style[0], lw=1.0, label=name)
        for bound in (LOW, HIGH):
            ax.axhline(bound, color=GREY, lw=0.7, ls=":")
        label(ax, "samples of a half cycle", "index" if title == "the signal" else "", title)
    axes.ravel()[0].legend(loc="center right")
    write_picture(figure, path)


CLAIM = Claim(
    claimed=(
        "He's index on the autocorrelation tells stiction (above .6) from other oscillations (below"
        " .4), on the control error; a monitor of control loops in public source, which states no"
        " figure. He et al. (2007), Ind. Eng. Chem. Res. 46, 4549, fit the signal itself"
    ),
    protocol=(
        "whole record; first five cycles of the autocorrelation; at least four half cycles whose"
        " mean length is above three standard deviations; two lines through an apex against a sine"
    ),
    stand_in="no filter of 30 s before it; the whole record in place of a moving hour",
    rows=rows,
    draw=draw,
)
