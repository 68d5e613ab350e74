"""From scores to probabilities of every effect, of none and of unknown; and the share of each block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.gap.assess import Assessment
from simbench.gap.names import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of


@dataclass(frozen=True)
class Weights:
    """Probabilities of every answer, and what stands behind `unknown`."""

    probability: dict[str, float]
    blocks: dict[str, float]
    unknown_block: str


TEMPERATURE = 0.35  # probabilities grow slower than likelihoods: the load is never the AR(2) it is taken for
NONE_SCORE = 4.0  # nats an effect must bring to be as probable as none; the bootstrap sets it per record
UNKNOWN_SCORE = -6.0
BEHIND = 6.0  # score by which a second named effect follows the first
STRANGE = 0.9  # probability of "unknown" once a residual test fails


def weigh(found: Assessment, none_score: float = NONE_SCORE) -> Weights:
    """Turn one record's scores into probabilities.

    Parameters
    ----------
    found : Assessment
    none_score : float
        Nats that chance alone brings the best effect on this loop.

    Returns
    -------
    Weights
    """
    scores = {e: compressed(found.gains[e]) for e in EFFECTS}
    if len(found.chosen) == 2:
        # its own evidence came on top of the first effect's, which the single scores do not show
        first, second = found.chosen
        scores[second] = max(scores[second], scores[first] - BEHIND)
    scores[NONE] = none_score
    scores[UNKNOWN] = UNKNOWN_SCORE
    x = np.array(list(scores.values())) * TEMPERATURE
    p = np.exp(x - x.max())
    p /= p.sum()
    if found.strange:
        p *= (1.0 - STRANGE) / (1.0 - p[-1])
        p[-1] = STRANGE
    probability = {e: float(v) for e, v in zip(scores, p)}
    excess = {
        b: max([compressed(found.gains[e]) for e in EFFECTS if block_of(e) == b and (e in found.chosen)] + [0.0])
        for b in BLOCKS
    }
    total = sum(excess.values())
    blocks = {b: (v / total if total > 0 else 0.0) for b, v in excess.items()}
    return Weights(probability, blocks, next(iter(found.strange), "process"))


def compressed(gain: float) -> float:
    """Return a gain with its far end squeezed: beyond some tens of nats more evidence is not more certainty."""
    return gain if gain < 30.0 else 30.0 + 15.0 * float(np.log(gain / 30.0))
