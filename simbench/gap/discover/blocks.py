"""Compare the best explanations of each block (known effects, empirical models, free parameters) if
no single model is certain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import scipy

from simbench.gap.decide.assess import Assessment
from simbench.gap.effects import NOT_TRIED
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec, size_penalty
from simbench.gap.likelihood.residual_tests import directions
from simbench.gap.situation import Situation, load_memory
from simbench.loop.effects import BLOCKS, EFFECTS, block_of

_NOISE = 6.0  # nats that any block may bring by chance, added to all
# share of the evidence from which a block is named: right in 19 of 38 between that and a half
_LEAST = 0.4
_STEPS = 4  # in which all other numbers are fitted again with a freedom
_FINER = 16  # times as many frequencies as the record has, among which a period is sought ...
_PERIODS = 3  # ... of which the record holds so many at least
_EVENTS = 8  # events at most
_LARGE = 3.5  # robust standard deviations from which an innovation is an event


class Located(NamedTuple):
    """The likeliest block and every block's share of the evidence; `doubt` says why it is not
    certain all the same.

    `nearest` is the known effect that explains most in each block, where one explains anything.
    """

    block: str
    shares: Mapping[str, float]
    doubt: str
    nearest: Mapping[str, str]

    @property
    def words(self) -> str:
        """The block with its share in a few words, or why none is certain."""
        words = f"{self.shares[self.block]:.2f} of the evidence lies in the {self.block} block"
        if self.block in self.nearest:
            words += f", where {self.nearest[self.block].replace('_', ' ')} explains most"
        return self.doubt or words


def located(
    assessment: Assessment, forms: Iterable[tuple[str, float]] = (), certain: str = ""
) -> Located:
    """Return the block of what a record shows; `forms` are block and nats of laws tried, `certain`
    needs no statistics.

    Every block counts by its best explanation, however many were tried. As no model of a left-out
    effect is quite true, shares are proportional to the gains in log-likelihood, not to their
    exponentials: such shares were right about as often as they claim (seeds 7401 and 7402,
    216 records).
    """
    gains = assessment.log_likelihood_gains
    nearest = {block_of(e): e for e in sorted(EFFECTS, key=gains.__getitem__) if gains[e] > 0.0}
    certain = certain or ("valve" if assessment.mv_unexplained else "")
    if certain:
        return Located(certain, {b: float(b == certain) for b in BLOCKS}, "", nearest)
    best = dict.fromkeys(BLOCKS, NOT_TRIED)
    tried = [(block_of(e), nats) for e, nats in gains.items()]
    for block, nats in (*tried, *forms, *_freed(assessment.situation, assessment.base)):
        best[block] = max(best[block], float(nats))
    weights = {b: max(nats + _NOISE, 1e-9) for b, nats in best.items()}
    shares = {b: weight / sum(weights.values()) for b, weight in weights.items()}
    first, second = sorted(BLOCKS, key=lambda b: -best[b])[:2]
    doubt = ""
    if best[first] < 0.0:
        doubt = f"no explanation stands out of the noise (best {best[first]:.1f} nats)"
    elif shares[first] < _LEAST:
        doubt = (
            f"cannot tell the block: of the evidence {first} has {shares[first]:.2f}, {second}"
            f" {shares[second]:.2f}"
        )
    return Located(first, shares, doubt, nearest)


def _freed(s: Situation, base: Fit) -> Iterator[tuple[str, float]]:
    """Yield block and nats of each freedom over the fit without effect, all else fitted again
    and its numbers paid for.
    """
    engine = Engine(s.data, load_memory(s))
    walk = 0.1 * float(np.std(s.data.y)) / np.sqrt(s.data.n)
    start = {"walk": walk, "load_walk": walk, **base.theta}
    for block, spec, count in _freedoms(s, base):
        fit = engine.fit(base.spec.join(spec), start, steps=_STEPS)
        yield block, fit.loglik - base.loglik - size_penalty(s.data.n, count)


def _freedoms(s: Situation, base: Fit) -> Iterator[tuple[str, Spec, float]]:
    """Yield block, freedom and numbers: another plant or valve, any noise, a period, drift and
    events of load or reading.
    """
    d, x = s.data, np.asarray(base.residual)
    at, T = np.arange(d.n), base.theta["T"] if d.T > 0 else 0.0
    for name, channels in directions(base, d).items():
        if name != "shape" or s.record.mv is None:
            block = "valve" if name == "shape" else "process"
            yield block, Spec(channels=channels), len(channels)
    yield "sensor", Spec(free=frozenset({"noise_std"})), 1.0
    frequency, power = scipy.signal.periodogram(x, nfft=_FINER * d.n)
    power[frequency < _PERIODS / d.n] = 0.0
    angle = 2.0 * np.pi * frequency[np.argmax(power)] * at
    yield "disturbance", Spec(channels=(np.sin(angle), np.cos(angle))), 4.0
    yield "sensor", Spec(walk=True, channels=(at / d.n,)), 2.0
    yield "disturbance", Spec(load_walk=True, channels=(kernels.plant(at / d.n, T, 0.0, 0.0),)), 2.0
    size = np.abs(x)
    size[: kernels.SKIP] = 0.0
    # 1.4826 medians are a standard deviation
    large, _ = scipy.signal.find_peaks(size, height=_LARGE * 1.4826 * float(np.median(size)))
    events = sorted(large, key=lambda k: -size[k])[:_EVENTS]
    if events:
        count = 2.0 * len(events)  # where each is counts as well
        yield "sensor", Spec(channels=tuple((at >= k).astype(float) for k in events)), count
        # a load passes the plant, and begins before it is seen
        loads = tuple(kernels.plant((at >= k - 1).astype(float), T, 0.0, 0.0) for k in events)
        yield "disturbance", Spec(channels=loads), count
