"""Which block, where no law is certain: the best explanation of each, known effects and forms of laws alike, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import softmax
from scipy.stats import norm
from scipy.stats import t as student

from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.classify import TEMPERATURE
from simbench.gap.effects import NOT_TRIED
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.residual_tests import of_load
from simbench.loop.effects import BLOCKS, EFFECTS, block_of

_NOISE = 0.0  # nats over "no effect" of the best explanation, below which all are within the noise
_HALF = 0.5  # share of the evidence that a block must carry
_TIMES = 9.0  # times its limit, from which a test needs no statistics
_FREEDOM = np.geomspace(2.0, 10.0, 4)  # degrees of freedom of the innovations' distribution that are tried
_ORDINARY = 70.0  # nats that the tails of an ordinary load's innovations bring
_LOUD = 4.0  # robust deviations


class Located(NamedTuple):
    """The likeliest block with its share of the evidence; `doubt` says why it cannot be told all the same.

    `nearest` is the known effect that explains most in each block, where one explains anything.
    """

    block: str
    share: float
    doubt: str
    nearest: Mapping[str, str]

    @property
    def words(self) -> str:
        """The block with its share in a few words, or why none can be told."""
        like = f", where {self.nearest[self.block].replace('_', ' ')} explains most" if self.block in self.nearest else ""
        return self.doubt or f"{self.share:.2f} of the evidence lies in the {self.block} block{like}"


def located(found: Assessment, forms: Iterable[tuple[str, float]] = (), certain: str = "") -> Located:
    """Return the block of what a record shows; `forms` are block and nats of laws tried, `certain` needs no statistics.

    Every block is as likely as any other beforehand, and stands by its best explanation, however many were tried.
    """
    gains = found.log_likelihood_gains
    nearest = {block_of(e): e for e in sorted(EFFECTS, key=gains.__getitem__) if gains[e] > _NOISE}
    certain = certain or max((f for f in found.failures if f[0] >= _TIMES), default=(0.0, "", ""))[1]
    if certain:
        return Located(certain, 1.0, "", nearest)
    said = [(block_of(e), nats) for e, nats in gains.items()]
    said += [*forms, *_tails(found.base)]
    best = {b: max((nats for one, nats in said if one == b), default=NOT_TRIED) for b in BLOCKS}
    shares = dict(zip(BLOCKS, softmax([TEMPERATURE * best[b] for b in BLOCKS])))
    block = max(BLOCKS, key=lambda b: best[b])
    doubt = ""
    if best[block] < _NOISE:
        doubt = f"no explanation stands out of the noise (best {best[block]:.1f} nats)"
    elif shares[block] < _HALF:
        doubt = f"cannot tell the block: none carries half of the evidence ({block} {shares[block]:.2f})"
    return Located(block, float(shares[block]), doubt, nearest)


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
    return [("disturbance" if of_load(x, loud, base) else "sensor", nats)]
