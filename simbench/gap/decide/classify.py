"""Turn gains of log-likelihood into the probabilities of every effect, of none and of unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, softmax

from simbench.gap.decide.assess import Assessment
from simbench.gap.effects import recogniser
from simbench.gap.thresholds import DOUBT, LEAST_NATS, TEMPERATURE
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of

# No answer hangs on these two (doubled or halved they change none of 72), only the probability that
# is printed beside a second effect.
SECOND_EFFECT_NATS = 4.0  # nats by which the likeliest second effect follows the first ...
PLAIN_SECOND_NATS = 16.0  # ... if it brings so much on top of it, and less by what it lacks
_SMALLEST = 1e-300  # stands for a probability that is too small for a number


@dataclass(frozen=True)
class Classified:
    """Probabilities of every answer, and the block of `unknown`."""

    probability: dict[str, float]
    unknown_block: str

    @property
    def shares(self) -> dict[str, float]:
        """Summed probability of what lies in each block, none left out; all 0 where none is the
        answer.
        """
        p = self.probability
        if max(p, key=lambda e: p[e]) == NONE:
            return dict.fromkeys(BLOCKS, 0.0)
        sums = {b: sum(v for e, v in p.items() if self.block(e) == b) for b in BLOCKS}
        whole = sum(sums.values())
        return {b: v / whole for b, v in sums.items()}

    def block(self, answer: str) -> str:
        """Return the block of an answer; that of `unknown` is the one that fails."""
        return self.unknown_block if answer == UNKNOWN else block_of(answer)


def doubt(ratio: float) -> float:
    """Return the share of `unknown` where a test is at so many times its limit: a half at it."""
    return float(expit(DOUBT * np.log(max(ratio, 1e-3))))


def classify(assessment: Assessment) -> Classified:
    """Turn one record's scores into probabilities.

    Notes
    -----
    `none` has a gain of `LEAST_NATS`; `unknown` takes the share that a logistic curve gives to
    the residual test which the best model fails by most, a half where it just fails. Where
    effects are rarer or subtler than in the loops of `TEMPERATURE`, the probabilities are too high.
    """
    gains = {e: assessment.log_likelihood_gains[e] for e in EFFECTS}
    if assessment.chosen:
        first = assessment.chosen[0]
        # evidence that comes on top of the first effect's, which gains over no effect at all do not
        # show
        on_top = assessment.log_likelihood_gains_on_top or gains
        others = {e: g for e, g in on_top.items() if block_of(e) != block_of(first)}
        most = max(PLAIN_SECOND_NATS, *others.values())
        for effect, gain in others.items():
            gains[effect] = max(gains[effect], gains[first] - SECOND_EFFECT_NATS - (most - gain))
    known = softmax(TEMPERATURE * np.array([*gains.values(), LEAST_NATS]))
    ratio, block = assessment.worst_test
    q = doubt(ratio)
    if ratio < 1.0 or set(assessment.chosen[:1]) & set(assessment.situation.proven):
        # while no test fails, or where an effect is proven, "unknown" is never the first
        # answer
        q = min(q, 0.99 * float(known.max()) / (1.0 + float(known.max())))
    p = {**dict(zip((*EFFECTS, NONE), (float(x) for x in (1.0 - q) * known))), UNKNOWN: q}
    if assessment.stiction is not None and not assessment.situation.trusted:
        p = _with_friction(p, assessment.stiction)
    return Classified(p, block)


def _with_friction(p: dict[str, float], stiction: float) -> dict[str, float]:
    """Return probabilities in which friction has the one it has in every verb; the others share the
    rest as before.
    """
    bands = {e for e in EFFECTS if recogniser(e).band is not None}
    if not any(p[e] for e in bands):  # too small for numbers: then none of them is likelier
        p = p | dict.fromkeys(bands, _SMALLEST)
    friction = sum(p[e] for e in bands)
    return {
        e: v * (stiction / friction if e in bands else (1.0 - stiction) / (1.0 - friction))
        for e, v in p.items()
    }
