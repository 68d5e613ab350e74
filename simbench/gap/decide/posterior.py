"""Turn rows of evidence into one posterior over every effect, none and unknown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import expit, softmax

from simbench.gap.effects import Parameters, is_friction
from simbench.gap.thresholds import (
    AFAR,
    EDGE,
    LEAST_NATS,
    LIKELIER,
    OF_TWO,
    SECOND_NATS,
    TEMPERATURE,
    UNKNOWN_BEFORE,
)
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of

_DIGITS = 14  # of a sum of probabilities, which floats round in the 16th
_SMALLEST = 1e-300  # stands for a probability that is too small for a number


@dataclass(frozen=True)
class Posterior:
    """Probability of every answer, which sum to 1, and the block of `unknown`."""

    probability: dict[str, float]
    unknown_block: str

    @property
    def first(self) -> str:
        """The most probable answer."""
        return max(self.probability, key=lambda e: self.probability[e])

    @property
    def friction(self) -> float:
        """Probability of stiction: the share of the effects with friction."""
        # a share that friction was given comes out as it was: what rounds below it denies nothing
        return round(sum(v for e, v in self.probability.items() if is_friction(e)), _DIGITS)

    @property
    def shares(self) -> dict[str, float]:
        """Summed probability of the effects of each block, and that of unknown; none left out, all
        0 where none is the answer.
        """
        p = self.probability
        sums = {}
        for b in BLOCKS + (UNKNOWN,):
            sums[b] = sum(v for e, v in p.items() if block_of(e) == b)
        if self.first == NONE:
            return dict.fromkeys(sums, 0.0)
        whole = sum(sums.values())
        return {b: v / whole for b, v in sums.items()}

    def block(self, answer: str) -> str:
        """Return the block of an answer; that of `unknown` is the one that fails."""
        if answer == UNKNOWN:
            return self.unknown_block
        return block_of(answer)

    def with_friction(self, share: float) -> Posterior:
        """Return the posterior in which friction has a share; the others keep their odds."""
        # what is too small for numbers: then none of its effects is likelier
        p = {}
        for e, v in self.probability.items():
            p[e] = max(v, _SMALLEST if is_friction(e) else 0.0)
        friction = others = 0.0
        for e, v in p.items():
            if is_friction(e):
                friction += v
            else:
                others += v
        by = {True: share / friction, False: (1.0 - share) / max(others, _SMALLEST)}
        return replace(self, probability={e: v * by[is_friction(e)] for e, v in p.items()})

    def afar(self, times: float, block: str, known: bool) -> Posterior:
        """Return the posterior where simulations with the first answer, which is no friction, stay
        `times` as far from the record as is near: something unknown in a block is likelier, but not
        before an effect that is likelier than not, or `known` by law or samples; friction, which is
        asked by itself, keeps its share.
        """
        # the share of unknown in all but friction; where no test was asked, by that before looking
        p = self.probability
        both = 1.0 - self.friction
        others = both - p[UNKNOWN]
        before = max(p[UNKNOWN] / others, UNKNOWN_BEFORE / (1.0 - UNKNOWN_BEFORE))
        share = float(expit(np.log(before) + AFAR * np.log(times)))

        # friction is no more the first than before
        stuck = max(v for e, v in p.items() if is_friction(e))
        first = p[self.first]
        if not known and (self.first == NONE or first < LIKELIER):
            share = max(share, stuck / both / EDGE)
        else:
            stays = EDGE * first / (others + EDGE * first)
            stays = min(stays, 1.0 - stuck * others / (EDGE * first * both))
            share = min(share, max(stays, p[UNKNOWN] / both))

        # what the others keep
        kept = (1.0 - min(share, EDGE)) * both / others
        probability = {}
        for e, v in p.items():
            if is_friction(e):
                probability[e] = v
            else:
                probability[e] = kept * v
        probability[UNKNOWN] = both - kept * others
        return replace(self, probability=probability, unknown_block=block)


def posterior(
    rows: Sequence[Evidence],
    first: str,
    on_top: Mapping[str, Mapping[str, float]],
    worst_test: tuple[float, str],
    friction: float | None = None,
) -> Posterior:
    """Return the posterior from rows, priors, and what second effects bring on top of the first.

    Parameters
    ----------
    rows : sequence of Evidence
        What is known by law or samples is in every model; nats of the others are over it.
    first : str
        The strongest effect, or `none`.
    on_top : mapping of str to mappings of str to float
        Nats that each effect of another block brings on top of the first, and of a rival of it.
    worst_test : (float, str)
        Largest probability that a fact or a residual test gives to something unknown, and its
        block.
    friction : float, optional
        Probability of friction where it is weighed apart from the other effects.

    Returns
    -------
    Posterior
        Probability of every effect, of none and of unknown.

    Notes
    -----
    An effect without a row has nothing to speak for it. `none` has `LEAST_NATS`, a second effect
    asks for `SECOND_NATS`, and of two effects together the weaker counts for `OF_TWO`, as the
    probabilities sum to 1. `unknown` has what the worst test gives it; it is not the first while
    that is less than a half, or where an effect is known.
    """
    known = known_by(rows)
    nats = nats_of(rows)
    apart = friction is not None

    # what is known takes the place of none: it is in every model
    if known:
        alone = known[0]
        least = SECOND_NATS
    else:
        alone = NONE
        least = LEAST_NATS
    others = {}
    for e, g in nats.items():
        if e != alone and not (apart and is_friction(e)):
            others[e] = g
    bands = {}
    for e, g in nats.items():
        if is_friction(e):
            bands[e] = g
    p = dict.fromkeys((*EFFECTS, NONE, UNKNOWN), 0.0) | _share_probability(others, alone, least)
    pairs = {}
    for one, brought in on_top.items():
        pairs[one] = _share_probability(brought, alone, SECOND_NATS)
    beside = pairs.get(first, {})
    share = friction or 0.0
    if not apart:
        share = sum(v for e, v in p.items() if is_friction(e))
        if not known:
            second = 0.0
            for one, brought in pairs.items():
                for e, x in brought.items():
                    if is_friction(e):
                        second += p[one] * x
            share += second
        share = min(max(share, 1.0 - EDGE), EDGE)
    if known:
        for e in others:
            p[alone] += (1.0 - OF_TWO) * p[e]
            p[e] *= OF_TWO
    elif apart and is_friction(first):
        # beside friction, whose share is its own, the others are what they bring on top of it too
        p = {e: (1.0 - OF_TWO) * v + OF_TWO * beside.get(e, 0.0) for e, v in p.items()}
    else:
        whole = p[first]
        for e in on_top.get(first, ()):
            p[first] -= OF_TWO * whole * beside[e]
            p[e] += OF_TWO * whole * beside[e]
    q, block = worst_test
    best = max(p.values())
    if q < LIKELIER or known:
        q = min(q, EDGE * best / (1.0 + best))
    p = {e: (1.0 - q) * v for e, v in p.items()} | {UNKNOWN: q}
    if apart and bands:
        weights = softmax(TEMPERATURE * np.array(list(bands.values())))
        p |= {e: float(x) for e, x in zip(bands, weights)}
    out = Posterior(p, block)
    if apart:
        return out.with_friction(share)
    sticks = any(map(is_friction, tuple(nats) + tuple(beside)))
    if not sticks:
        return out

    # where something is unknown, friction is what OP and PV show of it by themselves
    alone_nats = max((row.nats for row in rows if row.source == ALONE), default=-np.inf)
    return out.with_friction((1.0 - q) * share + q * float(expit(TEMPERATURE * alone_nats)))


def _share_probability(nats: Mapping[str, float], alone: str, least: float) -> dict[str, float]:
    """Return the probability of each effect, and of none of them, which has the `least` nats."""
    chances = softmax(TEMPERATURE * np.array([*nats.values(), least]))
    return {e: float(x) for e, x in zip((*nats, alone), chances)}


# --- One row of evidence: what one source shows of one effect.

LAW = "controller's law"
SAMPLES = "single samples"
MV = "MV"
PV = "PV beside OP"
ALONE = "OP and PV without a model"


@dataclass(frozen=True)
class Evidence:
    """What one source shows of one effect: nats over no effect, and the effect's numbers in the
    units of the loop file.
    """

    effect: str
    source: str
    nats: float
    numbers: Parameters = field(default_factory=dict)


def known_by(rows: Iterable[Evidence]) -> list[str]:
    """Return the effects that the controller's law or single samples show: every model has them."""
    return list(dict.fromkeys(row.effect for row in rows if row.source in (LAW, SAMPLES)))


def nats_of(rows: Iterable[Evidence]) -> dict[str, float]:
    """Return the sum of every effect's rows."""
    total: dict[str, float] = {}
    for row in rows:
        total[row.effect] = total.get(row.effect, 0.0) + row.nats
    return total
