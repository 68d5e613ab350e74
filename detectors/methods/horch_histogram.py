"""Horch 2006: downstream of a sticky valve the slope of a level jumps and rests; under a sine it
swings as a sine does; its histogram tells.

Needs: PV, three periods of a sustained oscillation; made for integrating processes (second
difference of PV), works on self-regulating ones (first difference) in the author's extension.
Parameters: `bound` (-) of the score; 0.5 takes the smaller error, as published; `least_A` (std of
the data), set here, 0 in the source: the smallest A of a camel.
Indices: mse_camel, mse_gauss >= 0, errors of the two fitted densities.
Rule: the histogram of the filtered difference is fitted by a Gaussian (kinks in PV leave a central
peak: stiction) and by the density of A cos(phi) plus Gaussian noise (a camel: no stiction); score =
mse_camel / (mse_camel + mse_gauss). With A = 0 the camel is a Gaussian and a free fit ties. The
source names no cut-off; here it is the highest harmonic that noise leaves clear.
Not for: noisy PV of a fast process: twice differenced noise is Gaussian too, and the filter's
cut-off then decides.
Source: A. Horch (2006), as cited by Jelali (2013), Sect 11.5.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.conditioning import noise_variance
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="histogram of PV's second difference: Gaussian or camel",
    source="Horch 2006",
    cannot_cope=("undersampled",),
    thresholds={
        "bound": Threshold(
            0.5, "-", 0.0, 1.0, "Horch 2006", "above: Gaussian, stiction; else camel, none"
        ),
        "least_A": Threshold(
            1.0, "std", 0.0, 1.5, "own; 0 in Horch 2006", "a camel's humps lie at least so far out"
        ),
    },
    published={"least_A": 0.0},
)

BINS = np.linspace(-3.5, 3.5, 31)  # in std of the data


def density_errors(d: np.ndarray, least_A: float = 1.0) -> tuple[float, float]:
    """Return the mean squared errors of the best bounded camel and the best Gaussian density of
    `d`, in units of its std.
    """
    z = (d - d.mean()) / d.std()
    density = np.histogram(z, BINS)[0] / (z.size * (BINS[1] - BINS[0]))
    gaussians, camels = _mean_densities(least_A)
    camel = float(((camels - density) ** 2).mean(axis=1).min())
    gauss = float(((gaussians - density) ** 2).mean(axis=1).min())
    return camel, gauss


def detect(prepared: Prepared, *, bound: float, least_A: float = 1.0) -> Verdict:
    """Judge a record by the histogram of the differences of PV.

    Parameters
    ----------
    prepared : Prepared
        The record.
    bound : float
        Bound of the score (-).
    least_A : float
        Smallest A of a camel (std of the differences).

    Returns
    -------
    Verdict
        Stiction where the score, the share of the camel's error in both errors (-), exceeds
        `bound`.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> record = LoopRecord(np.cos(t), np.sin(t), 0.1, process="integrating")
    >>> detect(Prepared(record), **METHOD.defaults()).verdict
    'no_stiction'
    """
    pv = prepared.record.pv
    period = prepared.period
    order = 2 if prepared.integrating else 1

    # the highest harmonic at which differenced noise still is a tenth of what a differenced sine
    # has
    power = 2 * order + 1
    clear = 0.05 * power * period * float(pv.var()) / max(noise_variance(pv), 1e-300)
    d = np.diff(
        prepared.band("pv", period / float(np.clip(clear ** (1.0 / power), 3.0, 10.0))), order
    )

    # The ends are left out, where the filter has no samples on both sides
    edge = round(period / 2)
    d = d[edge:-edge]
    if d.size < 60 or d.std() == 0.0:
        return Verdict(
            "horch_histogram", NO_DECISION, reason=f"{d.size} differences; at least 60 are needed"
        )

    # Which density the differences have
    camel, gauss = density_errors(d, least_A)
    if camel + gauss > 0:
        score = camel / (camel + gauss)
    else:
        score = 0.5
    if score > bound:
        verdict = STICTION
        form = "a central peak"
    else:
        verdict = NO_STICTION
        form = "two humps"
    reason = f"differences of PV have {form}: mse_camel = {camel:.3g}, mse_gauss = {gauss:.3g}"
    return Verdict(
        "horch_histogram", verdict, score, {"mse_camel": camel, "mse_gauss": gauss}, reason=reason
    )


@lru_cache(maxsize=4)
def _mean_densities(least_A: float) -> tuple[np.ndarray, np.ndarray]:
    """Gaussians of std 0.15..1.5 and camels of A `least_A`..1.6, std 0.1..1, as mean densities of
    the bins.
    """
    # steps so small that the better family is not the one that a template happens to fall on
    edge = BINS[None]
    width = BINS[1] - BINS[0]
    gaussians = np.diff(_normal_cdf(edge / np.geomspace(0.15, 1.5, 59)[:, None]), axis=1) / width
    phase = (np.arange(60) + 0.5) * (np.pi / 60)
    A, sigma = (
        g.reshape(-1, 1, 1)
        for g in np.meshgrid(np.linspace(least_A, 1.6, 13), np.geomspace(0.1, 1.0, 19))
    )
    camels = (
        np.diff(_normal_cdf((BINS - A * np.cos(phase)[:, None]) / sigma).mean(axis=1), axis=1)
        / width
    )
    return gaussians, camels


def _normal_cdf(x: np.ndarray) -> np.ndarray:
    """Cumulative normal distribution."""
    from scipy.special import ndtr

    return ndtr(x)
