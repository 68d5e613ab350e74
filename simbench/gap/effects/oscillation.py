"""Recognise an external oscillation: fit a sine at the sharpest peak in the spectrum of the
prediction errors.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.signal.filters import coherence
from simbench.gap.effects._recogniser import Parameters, Recogniser, clip
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec, input_gain
from simbench.gap.likelihood.search import SMOOTH
from simbench.gap.situation import Situation
from simbench.gap.thresholds import FEWEST_SWINGS, LARGER

_SAME_PERIOD = 0.05  # |ln ratio| of periods, beyond which a sine is another one
_SHORTEST = 4.0  # samples per period: of a faster sine too little is seen
# share of its phase that PV or OP keeps about the period: of 26 loops of two simulators that an
# oscillation swings .63 at least, of 25 others .57 at most
_SWINGS = 0.6
_LOWEST = 12  # bins of a spectrum four times as fine as the record's: three whole periods


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Find the sharpest peak of the innovations' periodogram, refine its frequency, add the
    sine.
    """
    n = engine.data.n
    data = engine.data
    white = np.asarray(base.residual) - np.mean(base.residual)
    power = np.abs(np.fft.rfft(white, 4 * n)) ** 2
    t = np.arange(n)

    def at(bin_: float) -> Spec:
        w = 2 * np.pi * bin_ / (4 * n)
        return base.spec.join(Spec(channels=(np.sin(w * t), np.cos(w * t))))

    fastest = int(4 * n / _SHORTEST)
    best = float(_LOWEST + int(np.argmax(power[_LOWEST:fastest])))
    value = -np.inf
    for step in (1.0, 0.3):
        keep = best
        for shift in (-2, -1, 0, 1, 2):
            trial = best + shift * step
            level = engine.evaluate(at(trial), base.theta)
            if level > value:
                value = level
                keep = trial
        best = keep

    # the peak was picked out of n/2 others
    count = 2.0 + 2.0
    if max(coherence(x, 4 * n / best) for x in (data.y, data.u)) < _SWINGS:
        return base, count
    fit = engine.fit(at(best), {**base.theta, "load": 0.5 * base.theta["load"]}, search=SMOOTH)
    fit.theta["period"] = 4 * n / best
    return fit, count


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return amplitude (%) at the plant's input and period (s)."""
    w = 2 * np.pi / fit.theta["period"]
    if s.data.T > 0:
        pole = abs(1.0 / (1j * w * fit.theta.get("T", 1.0) + 1.0))
    else:
        pole = 1.0 / w
    amplitude = float(np.hypot(*fit.beta[-2:])) / (abs(input_gain(fit, s.data)) * pole)
    return {"amplitude": clip(amplitude, 0.0, 100.0), "period": fit.theta["period"] * s.record.Ts}


def ordinary(fit: Fit, s: Situation) -> bool:
    """Return whether a sine is one that healthy records show, or of so few periods that it is a
    load that wanders as far as theirs, or as that of an identified loop does.
    """
    period = fit.theta["period"]
    amplitude = float(np.hypot(*fit.beta[-2:]))
    stated = any(
        abs(np.log(period / p)) < _SAME_PERIOD and amplitude < LARGER * a for p, a in s.data.sines
    )
    p = numbers(fit, s)
    near = float(p["amplitude"]) <= LARGER * s.data.loads.get("slow", 0.0)
    return stated or (wanders(p, s.record.duration) and (near or not s.trusted))


def wanders(p: Parameters, duration: float) -> bool:
    """Return whether a sine has so few periods that it is a load that wanders."""
    return float(p["period"]) * FEWEST_SWINGS > duration


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    ordinary=ordinary,
)
