"""Which block, where no law is certain: the evidence of all that was tried, known effects and forms of laws alike, pooled."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import softmax
from scipy.stats import norm
from scipy.stats import t as student

from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.classify import TEMPERATURE
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import Fit
from simbench.loop.effects import BLOCKS, EFFECTS, block_of

_NOISE = 0.0  # nats over "no effect" of the best explanation, below which all are within the noise
_HALF = 0.5  # share of the evidence that a block must carry
_TIMES = 9.0  # times its limit, from which a test needs no statistics
_FREEDOM = np.geomspace(2.0, 10.0, 4)  # degrees of freedom of the innovations' distribution that are tried
_ORDINARY = 70.0  # nats that the tails of an ordinary load's innovations bring
_LOUD, _FOLLOWED = 4.0, 0.3  # robust deviations, and the share of one that the next sample keeps where a load made it


class Located(NamedTuple):
    """The block that carries most of the evidence, with its share; "" where no block can be told, then why.

    `nearest` is the known effect that explains most in each block, where one explains anything.
    """

    block: str
    share: float
    why: str
    nearest: Mapping[str, str]

    @property
    def words(self) -> str:
        """The block with its share, or why none can be told, in a few words."""
        if not self.block:
            return self.why
        like = f", where {self.nearest[self.block].replace('_', ' ')} explains most" if self.block in self.nearest else ""
        return f"{self.share:.2f} of the evidence lies in the {self.block} block{like}"


def located(found: Assessment, forms: Iterable[tuple[str, float]] = (), certain: str = "") -> Located:
    """Return the block of what a record shows; `forms` are block and nats of laws tried, `certain` needs no statistics."""
    gains = found.log_likelihood_gains
    known = sorted((e for e in gains if gains[e] > _NOISE and e in EFFECTS), key=lambda e: gains[e])
    nearest = {block_of(e): e for e in known}
    certain = certain or max((f for f in found.failures if f[0] >= _TIMES), default=(0.0, "", ""))[1]
    if certain:
        return Located(certain, 1.0, "", nearest)
    said = [(block_of(e), nats) for e, nats in gains.items()]
    said += [*forms, *_tails(found.base)]
    weights, best = softmax([TEMPERATURE * nats for _, nats in said]), max(nats for _, nats in said)
    shares = {b: float(sum(w for (one, _), w in zip(said, weights) if one == b)) for b in BLOCKS}
    block = max(shares, key=lambda b: shares[b])
    if best < _NOISE:
        return Located("", shares[block], f"no explanation stands out of the noise (best {best:.1f} nats)", nearest)
    if shares[block] < _HALF:
        why = f"cannot tell the block: none carries half of the evidence ({block} {shares[block]:.2f})"
        return Located("", shares[block], why, nearest)
    return Located(block, shares[block], "", nearest)


def _tails(base: Fit) -> list[tuple[str, float]]:
    """Return block and nats of innovations that are rarely large: those of a load last, a reading's are taken back."""
    x = np.asarray(base.residual)[kernels.SKIP :]
    x = (x - np.median(x)) / (1.4826 * np.median(np.abs(x - np.median(x))) or 1.0)
    wide = float(np.std(x)) or 1.0
    heavy = max(float(student.logpdf(x, v, scale=scale).sum()) for v in _FREEDOM for scale in (1.0, 0.5 + 0.5 * wide))
    nats = heavy - float(norm.logpdf(x, scale=wide).sum()) - _ORDINARY
    loud = np.flatnonzero(np.abs(x[:-1]) > _LOUD)
    if not loud.size or nats <= 0.0:
        return []
    follows = float(np.sum(x[loud + 1] * x[loud]) / np.sum(x[loud] ** 2))
    return [("disturbance" if follows > _FOLLOWED else "sensor", nats)]
