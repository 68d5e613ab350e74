"""Recognise outliers: samples off the line through their neighbours, or prediction errors too large
for Gaussian noise.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln

from detectors.signal.tails import heavy_tails
from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.effects._smallest import Probe
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import Fit, size_penalty
from simbench.gap.situation import Situation

_FAR = 4.0  # robust standard deviations from which an innovation may be a spike's
# share of its height that a spike must lie off the mean of its neighbours; a step lies off by half
_GONE = 0.75
_TAILS = (6.0, 10.0, 20.0)  # degrees of freedom of heavy-tailed noise ...
_SCALES = np.linspace(0.4, 1.0, 13)  # ... and its scales, in standard deviations
_ALONE = 0.7  # share of a spike that its neighbours in the innovations stay below


def proven(s: Situation) -> Parameters | None:
    """Return the spikes that single samples show."""
    return None if s.archive.spikes is None else dict(zip(("rate", "size", "at"), s.archive.spikes))


def by_innovations(base: Fit, s: Situation) -> tuple[float, Parameters] | None:
    """Score a mixture of rare wide innovations against Gaussian ones."""
    x = np.asarray(base.residual)[kernels.SKIP :]
    if heavy_tails(x):
        return None
    scale = 1.4826 * float(np.median(np.abs(x))) or 1.0
    z = np.abs(x) / scale
    far = np.flatnonzero(z > _FAR)
    # a spike leaves one large innovation; a step or a slip leaves several of one sign
    alone = [
        k
        for k in far
        if z[max(k - 2, 0) : k].max(initial=0) < _ALONE * z[k]
        and z[k + 1 : k + 3].max(initial=0) < _ALONE * z[k]
    ]
    # a spike is gone a sample later; what a load has moved is not
    pv = np.asarray(s.record.pv)
    alone = [k for k in alone if _gone_again(pv, k + kernels.SKIP)]
    if len(alone) < 3 or len(alone) < 0.6 * len(far):
        return None
    heights = z[alone] * scale
    rate = len(alone) / x.size
    wide = float(np.std(heights)) + float(np.mean(heights))
    mixture = np.log(
        (1 - rate) * np.exp(-0.5 * (x / scale) ** 2) / scale
        + rate * np.exp(-0.5 * (x / wide) ** 2) / wide
    )
    at = "loop" if s.law.known else "record"
    parameters: Parameters = {
        "rate": rate,
        "size": float(np.mean(heights)) * base.theta["noise_std"],
        "at": at,
    }
    return float(np.sum(mixture) - _by_tails(x) - size_penalty(x.size, 2.0)), parameters


def _by_tails(x: np.ndarray) -> float:
    """Return the log-likelihood of noise without spikes, up to a constant: Gaussian, or Student's t
    with heavy tails.
    """
    std = float(np.std(x))
    best = float(np.sum(-0.5 * (x / std) ** 2 - np.log(std)))
    for nu in _TAILS:
        level = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(0.5 * nu)
        for scale in std * _SCALES:
            t = level - 0.5 * (nu + 1.0) * np.log1p((x / scale) ** 2 / nu) - np.log(scale)
            best = max(best, float(np.sum(t)))
    return best


def _gone_again(pv: np.ndarray, k: int) -> bool:
    """Return whether PV lies off both its neighbours at sample k by about as much as it jumped
    there.
    """
    if not 1 <= k < pv.size - 1:
        return False
    return bool(abs(pv[k] - 0.5 * (pv[k - 1] + pv[k + 1])) > _GONE * abs(pv[k] - pv[k - 1]))


def remark(s: Situation) -> str:
    """Return how many spikes there are, and when the first one is."""
    spikes = s.samples.spikes
    return (
        f"{spikes.size} isolated, the first {spikes[0] * s.record.Ts:g} s after the start"
        if spikes.size
        else ""
    )


def smallest(probe: Probe) -> tuple[float, str]:
    """Return the height that exceeds the innovations."""
    spread = float(np.sqrt(np.mean(probe.base.residual[kernels.SKIP :] ** 2)))
    return _FAR * spread * probe.base.theta["noise_std"], "PV units"


RECOGNISER = Recogniser(
    proven=proven,
    explains="spikes",
    by_innovations=by_innovations,
    remark=remark,
    smallest=smallest,
)
