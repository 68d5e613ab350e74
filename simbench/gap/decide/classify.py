"""From evidence to probabilities of every effect, of none and of unknown, by boosted trees trained on simulated loops.

The trees only weigh physical scores (`simbench.gap.decide.evidence`); `python -m simbench.gap.decide.training.fit` grew them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import expit, softmax

from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import LIMITS, Assessment, uncapped
from simbench.gap.decide.evidence import Row, evidence, squashed
from simbench.gap.effects import NOT_TRIED
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of

LEARNED = Path(__file__).parent / "learned"
TEMPERATURE = 0.35  # of the softmax where the baseline was identified: such likelihoods overstate
NONE_GAIN = 4.0  # nats an effect must bring there to be as probable as none
BEHIND = 6.0  # nats by which a second effect follows the first there
UNEXPLAINED = 0.9  # probability of "unknown" there once a test fails
NUMBERS = ("temperature", "slope", "offset", "none_bias")


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

    def block(self, answer: str) -> str:
        """Return the block of an answer; that of `unknown` is the one that fails."""
        return self.unknown_block if answer == UNKNOWN else block_of(answer)


def classify(found: Assessment, runs: ClosedLoops | None = None) -> Classified:
    """Turn one record's scores into probabilities.

    Parameters
    ----------
    found : Assessment
    runs : ClosedLoops, optional
        Simulated loops of this assessment, to be shared with a report.

    Returns
    -------
    Classified

    Notes
    -----
    Calibrated on the loops of `simbench.gap.decide.training`, half of them with one effect; where effects are rarer or
    subtler than there, the probabilities are too high.

    Examples
    --------
    >>> from simbench.gap.decide.assess import assess
    >>> from simbench.gap.intake.check import check
    >>> from simbench.gap.random_case import random_case
    >>> case = random_case(3, ("detuning",))
    >>> weights = classify(assess(check(case.record, case.baseline)))
    >>> weights.probability["detuning"] > 0.9, round(sum(weights.probability.values()), 6)
    (True, 1.0)
    """
    p = _by_trees(found, runs) if found.situation.trusted else by_gain(found)
    whole = np.sum(list(p.values()))
    return Classified({e: float(v / whole) for e, v in p.items()}, _unexplained_block(found))


def _by_trees(found: Assessment, runs: ClosedLoops | None) -> dict[str, float]:
    """Return the trees' probabilities; what they never saw takes its share by its likelihood's lead over all they know."""
    learned = _models()[2]["effects"]
    rows = evidence(found, runs, [e for e in learned if e in EFFECTS])
    known = dict(zip((*learned, NONE, UNKNOWN), probabilities([rows])[0]))
    p = {e: known.get(e, 0.0) for e in (*EFFECTS, NONE, UNKNOWN)}
    unseen = [e for e in EFFECTS if e not in learned]
    if not unseen:
        return p
    gains = {e: uncapped(g) for e, g in found.log_likelihood_gains.items()}
    best = max(NONE_GAIN, *(g for e, g in gains.items() if e in learned))
    share = softmax(TEMPERATURE * np.array([best, *(gains[e] for e in unseen)]))
    return {e: v * share[0] for e, v in p.items()} | dict(zip(unseen, share[1:]))


def by_gain(found: Assessment) -> dict[str, float]:
    """Return probabilities by a softmax of the gains: where the baseline was identified, as the trees never saw such fits.

    Parameters
    ----------
    found : Assessment

    Returns
    -------
    dict of str to float
        Every effect, none and unknown; they sum to 1.
    """
    gains = np.array([found.log_likelihood_gains[e] for e in EFFECTS])
    # beyond some tens of nats more evidence is not more certainty
    gains = np.where(gains < 30.0, gains, 30.0 + 15.0 * np.log(np.maximum(gains, 30.0) / 30.0))
    if len(found.chosen) == 2:
        # its own evidence came on top of the first effect's, which the single gains do not show
        first, second = (list(EFFECTS).index(e) for e in found.chosen)
        gains[second] = max(gains[second], gains[first] - BEHIND)
    x = TEMPERATURE * np.append(gains, NONE_GAIN)
    p = np.exp(x - x.max())
    q = UNEXPLAINED if found.unexplained else 1.0 - UNEXPLAINED
    return dict(zip((*EFFECTS, NONE, UNKNOWN), np.append((1.0 - q) * p / p.sum(), q)))


def _unexplained_block(found: Assessment) -> str:
    """Return the block in which the best model fails most."""
    if found.unexplained:
        return next(iter(found.unexplained))
    worst = max(LIMITS, key=lambda name: found.tests[name] / LIMITS[name][0])
    if found.tests[worst] > 0.5 * LIMITS[worst][0]:
        return LIMITS[worst][1]
    return block_of(found.chosen[0]) if found.chosen else LIMITS[worst][1]


def probabilities(rows: Sequence[Mapping[str, Row]]) -> np.ndarray:
    """Return the probabilities of every effect, none and unknown for the evidence of some records.

    Parameters
    ----------
    rows : sequence of dict
        From `evidence`.

    Returns
    -------
    ndarray, shape (records, answers)
        The effects that the trees learned, in their order, then none, then unknown; each row sums to 1.
    """
    ranks, outside, c = _models()
    columns = (c["effects"], c["record"], c["effect"])
    X = [candidate_rows(r, *columns) for r in rows]
    z = ranks.predict(np.vstack(X), raw_score=True).reshape(len(rows), -1)
    u = outside.predict(np.array([record_row(r, *columns) for r in rows]), raw_score=True)
    return combined(z, u, *(c[name] for name in NUMBERS))


def combined(
    z: np.ndarray, u: np.ndarray, temperature: float, slope: float, offset: float, none_bias: float = 0.0
) -> np.ndarray:
    """Return probabilities from the scores of the known answers (records, 23) and of `unknown` (records,).

    Parameters
    ----------
    z, u : ndarray, shapes (records, 23) and (records,)
    temperature : float
        Of the softmax over the known answers.
    slope, offset : float
        Of the logit of unknown.
    none_bias : float
        Logit added to none, so that an effect is seldom named where there is none.

    Returns
    -------
    ndarray, shape (records, 24)
    """
    z = z / temperature
    z[:, -1] += none_bias
    p = np.exp(z - z.max(axis=1, keepdims=True))
    p /= p.sum(axis=1, keepdims=True)
    q = expit(slope * u + offset)
    return np.hstack([p * (1.0 - q)[:, None], q[:, None]])


def candidate_rows(rows: Mapping[str, Row], effects: Sequence[str], record: Sequence[str], effect: Sequence[str]) -> np.ndarray:
    """Return one line per effect and for none: its number and block, its own evidence, the record's; NaN where missing."""
    common = [rows["record"].get(k, np.nan) for k in record]
    lines = []
    for i, answer in enumerate((*effects, NONE)):
        own = rows.get(answer, {})
        block = BLOCKS.index(block_of(answer)) if answer in EFFECTS else len(BLOCKS)
        lines.append([i, block, *(own.get(k, np.nan) for k in effect), *common])
    return np.array(lines, dtype=float)


def record_row(rows: Mapping[str, Row], effects: Sequence[str], record: Sequence[str], effect: Sequence[str]) -> np.ndarray:
    """Return the line on which `unknown` rests: the strongest effect and its evidence, the record's, and all gains."""
    gains = [rows.get(e, {}).get("gain", squashed(NOT_TRIED)) for e in effects]
    best = int(np.argmax(gains))
    own = [rows.get(effects[best], {}).get(k, np.nan) for k in effect]
    common = [rows["record"].get(k, np.nan) for k in record]
    return np.array([best, *own, *common, *gains], dtype=float)


@cache
def _models() -> tuple[Any, Any, dict[str, Any]]:
    import lightgbm

    ranks, outside = (lightgbm.Booster(model_file=str(LEARNED / f"{name}.txt")) for name in ("known", "unknown"))
    return ranks, outside, json.loads((LEARNED / "calibration.json").read_text(encoding="utf-8"))
