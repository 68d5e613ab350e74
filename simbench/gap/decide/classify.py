"""From log-likelihood gains to probabilities of every effect, of none and of unknown: a softmax and a logistic curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, softmax

from simbench.gap.decide.assess import ASKED, Assessment
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of

TEMPERATURE = 0.25  # of the softmax: such likelihoods overstate, as no model of load and noise is quite true
BEHIND = 6.0  # nats by which a second effect follows the first
SHARPNESS = 0.7  # of unknown, by the logarithm of how far the worst residual test is beyond its limit


@dataclass(frozen=True)
class Classified:
    """Probabilities of every answer, and the block that stands behind `unknown`."""

    probability: dict[str, float]
    unknown_block: str

    @property
    def shares(self) -> dict[str, float]:
        """Summed probability of what lies in each block, none left out; all 0 where none is the answer."""
        p = self.probability
        if max(p, key=lambda e: p[e]) == NONE:
            return dict.fromkeys(BLOCKS, 0.0)
        sums = {b: sum(v for e, v in p.items() if self.block(e) == b) for b in BLOCKS}
        whole = sum(sums.values())
        return {b: v / whole for b, v in sums.items()}

    def refuted(self, effect: str) -> Classified:
        """Return the same with the probability of an effect given to `unknown`, in the effect's block."""
        p = dict(self.probability)
        p[UNKNOWN], p[effect] = p[effect] + p[UNKNOWN], 0.0
        return Classified(p, block_of(effect))

    def block(self, answer: str) -> str:
        """Return the block of an answer; that of `unknown` is the one that fails."""
        return self.unknown_block if answer == UNKNOWN else block_of(answer)


def classify(found: Assessment) -> Classified:
    """Turn one record's scores into probabilities.

    Parameters
    ----------
    found : Assessment

    Returns
    -------
    Classified

    Notes
    -----
    `none` stands for a gain of `ASKED`; `unknown` takes the share that a logistic curve gives to the residual test which
    the best model fails by most, a half where it just fails. `TEMPERATURE` and `SHARPNESS` are the likeliest on 792 development
    loops of three independent simulators; where effects are rarer or subtler, the probabilities are too high.

    Examples
    --------
    >>> from simbench.gap.decide.assess import assess
    >>> from simbench.gap.intake.check import check
    >>> from simbench.gap.random_case import random_case
    >>> case = random_case(3, ("detuning",))
    >>> weights = classify(assess(check(case.record, case.baseline)))
    >>> weights.probability["detuning"] > 0.8, round(sum(weights.probability.values()), 6)
    (True, 1.0)
    """
    gains = {e: found.log_likelihood_gains[e] for e in EFFECTS}
    if len(found.chosen) == 2:
        # its own evidence came on top of the first effect's, which the single gains do not show
        first, second = found.chosen
        gains[second] = max(gains[second], gains[first] - BEHIND)
    known = softmax(TEMPERATURE * np.array([*gains.values(), ASKED]))
    ratio, block = found.worst_test
    q = float(expit(SHARPNESS * np.log(max(ratio, 1e-3))))
    if ratio < 1.0:
        # while no test fails, "unknown" is never the answer, however little is known of what the effect is
        q = min(q, 0.99 * float(known.max()) / (1.0 + float(known.max())))
    p = dict(zip((*EFFECTS, NONE), (float(x) for x in (1.0 - q) * known)))
    return Classified({**p, UNKNOWN: q}, block)
