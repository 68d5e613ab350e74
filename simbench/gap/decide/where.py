"""Where the gap lies: the share of every block, each driven with the recorded signal in front of it, with an interval."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from simbench.gap.decide.assess import LIMITS, SECOND, Assessment, beyond_healthy
from simbench.gap.decide.block_residuals import law_residuals, loglik, mv_residuals, sample_misfit, spikes, spread_to
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import LOAD_MEMORY, load_memory
from simbench.loop.effects import BLOCKS, EFFECTS, block_of

SOURCE = (
    "Kunsch (1989), Ann. Statist. 17, 1217: moving blocks; Shapley (1953): what two effects explain alike is halved; "
    "Huggins and Miller (2023), Bayesian Anal. 18, 79: posterior weights averaged over resampled data"
)
DRAWS = 200
MEMORY = 3.0  # length of a resampled block, in time scales of the loop
FAINT = 4.0  # nats that chance brings the best effect, where no bootstrap has said
DEGREES = {"memory": 25, "input": 25, "bursts": 9, "tails": 1}  # degrees of freedom of the standardised residual tests


@dataclass(frozen=True)
class BlockShare:
    """One block's part of the gap: `share`, 5 to 95 % interval `lo`..`hi` (all 0..1), and what was found, in one sentence."""

    share: float
    lo: float
    hi: float
    says: str


@dataclass(frozen=True)
class Where:
    """Every block's part of the gap; shares sum to 1, or all are 0 when nothing beats "no effect"."""

    blocks: dict[str, BlockShare]

    @property
    def shares(self) -> dict[str, float]:
        """Share of every block."""
        return {b: s.share for b, s in self.blocks.items()}


@dataclass
class _Told:
    """Nats each block owns, "nothing" as the last row: as observed, and in every draw; and what was found there."""

    draws: np.ndarray
    says: dict[str, list[str]] = field(default_factory=lambda: {b: [] for b in BLOCKS})

    def add(self, block: str, nats: np.ndarray, says: str = "") -> None:
        self.draws[BLOCKS.index(block)] += nats
        if says:
            self.says[block].append(says)


def where(found: Assessment, level: float = FAINT, seed: int = 0) -> Where:
    """Share the gap among the blocks.

    Everything is counted in nats of one-step prediction. Between input (MV, or OP where MV is not recorded) and PV they are
    the log-likelihood that the baseline gains once one block alone, or the two named ones, are freed; the explanations are
    weighted by their likelihood, and what two named blocks explain alike is halved. Where a law or a map is exact
    (controller, valve under a recorded MV, single samples) no likelihood exists, and a misfit of power P beside a signal of
    power Q counts n/2 ln(1 + P/Q), as it would in Gaussian innovations. The interval is that of `DRAWS` moving-block
    resamplings of the record's samples, the share their mean.

    Parameters
    ----------
    found : Assessment
        One record's.
    level : float
        Nats an effect must bring to be as probable as none.
    seed : int
        Of the resampling.

    Returns
    -------
    Where

    Notes
    -----
    Not for evidence added up over several records: the shares are those of the one record that `found` holds. Source:
    see `SOURCE`.

    Examples
    --------
    >>> from simbench.gap.decide.assess import assess
    >>> from simbench.gap.intake.check import check
    >>> from simbench.gap.random_case import random_case
    >>> case = random_case(3, ("detuning",))
    >>> placed = where(assess(check(case.record, case.baseline)))
    >>> round(placed.blocks["controller"].share, 2), round(placed.blocks["valve"].share, 2)
    (1.0, 0.0)
    """
    s = found.situation
    rng = np.random.default_rng([seed, 53])
    pick = _Resampling(s.record.n, load_memory(s) / LOAD_MEMORY * MEMORY, rng)
    told = _Told(np.zeros((len(BLOCKS) + 1, DRAWS + 1)))
    sure = {block_of(e) for e in s.proven} | ({"controller"} if s.unexplained_law else set())
    answered = bool(sure or found.unexplained or max(found.log_likelihood_gains.values()) > level)
    if answered:
        _controller(found, pick, told)
        _sensor(found, pick, told)
        _valve(found, pick, told, level)
        _plant(found, pick, told, max(level, SECOND) if s.proven else level)
        _strange(found, rng, told)
    nats, total = told.draws[:-1], told.draws.sum(axis=0)
    if answered and nats[:, 0].sum() <= 0.0:
        # the evidence is another record's, or too faint in this one to be placed
        block = next(
            iter([*(block_of(e) for e in found.chosen), *found.unexplained]),
            max(EFFECTS, key=lambda e: found.log_likelihood_gains[e]),
        )
        return _unplaced(block if block in BLOCKS else block_of(block), found)
    parts = nats / np.where(total > 0.0, total, 1.0)
    mean = parts[:, 1:].sum(axis=1)
    mean /= mean.sum() or 1.0
    lo, hi = np.quantile(parts[:, 1:], [0.05, 0.95], axis=1)
    return Where({
        b: BlockShare(float(m), float(min(q, m)), float(max(p, m)), _sentence(b, found, told.says[b], float(m)))
        for b, m, q, p in zip(BLOCKS, mean, lo, hi)
    })  # fmt: skip


class _Resampling:
    """Moving-block resampling of per-sample values, column 0 the record itself."""

    def __init__(self, n: int, length: float, rng: np.random.Generator) -> None:
        self.n = n
        self.length = int(np.clip(length, 5, n // 5))
        self.starts = rng.integers(0, n - self.length + 1, (DRAWS, -(-n // self.length)))

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Return the sum of values (..., n), then that of every draw, shape (..., DRAWS + 1)."""
        total = np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(values, axis=-1)], axis=-1)
        parts = total[..., self.length :] - total[..., : -self.length]
        drawn = parts[..., self.starts].sum(axis=-1) * (self.n / (self.starts.shape[1] * self.length))
        return np.concatenate([total[..., -1:], drawn], axis=-1)

    def nats(self, misfit: np.ndarray, signal: np.ndarray) -> np.ndarray:
        """Return n/2 ln(1 + P/Q) of a misfit's power (n,) beside a signal's (n,), observed and drawn."""
        P, Q = self.sums(np.stack([misfit, signal]))
        return 0.5 * self.n * np.log1p(np.maximum(P, 0.0) / np.maximum(Q, 1e-12 * signal.sum() + 1e-300))


def _controller(found: Assessment, pick: _Resampling, told: _Told) -> None:
    """Count what the baseline's law, driven with the recorded error, leaves of OP's changes."""
    s = found.situation
    du = np.diff(s.op, prepend=s.op[0])
    bare, freed, _ = law_residuals(s)
    own = [e for e in s.proven if block_of(e) == "controller"]
    if not own and not s.unexplained_law:
        return
    rest = np.zeros_like(freed) if s.unexplained_law else freed
    nats = pick.nats(bare**2 - rest**2, du**2)
    told.add("controller", nats, s.unexplained_law or _words(own))


def _sensor(found: Assessment, pick: _Resampling, told: _Told) -> None:
    """Count what single samples of PV show, beside the changes of the PV that the plant gave."""
    s = found.situation
    own = [e for e in s.proven if block_of(e) == "sensor"]
    if own or s.frozen:
        told.add("sensor", pick.nats(sample_misfit(s), np.diff(s.plant_pv, prepend=s.plant_pv[0]) ** 2), _words(own))


def _valve(found: Assessment, pick: _Resampling, told: _Told, level: float) -> None:
    """Count what an ideal valve, driven with OP, leaves of the recorded MV, beside OP's own movement."""
    s = found.situation
    own = [e for e in EFFECTS if block_of(e) == "valve" and s.record.mv is not None]
    best = max(own, key=lambda e: found.log_likelihood_gains[e], default="")
    if not best or (found.log_likelihood_gains[best] <= level and "valve" not in found.unexplained):
        return
    bare, freed = mv_residuals(s, best, found.parameters[best])
    healthy = beyond_healthy(float(found.parameters[best]["S"])) if best in ("stiction", "deadband") else 1.0
    if "valve" in found.unexplained:
        freed, healthy = np.zeros_like(freed), 1.0
    told.add("valve", healthy * pick.nats(bare**2 - freed**2, (s.op - s.op.mean()) ** 2), best)


def _plant(found: Assessment, pick: _Resampling, told: _Told, level: float) -> None:
    """Share the innovations' likelihood among the blocks that explain them, likelier ones first, two named ones together."""
    s = found.situation
    if sum(e in s.proven for e in found.chosen) == 2:
        return
    settled = {block_of(e) for e in s.proven}
    gains = {e: _allowed(found, e, c.fit) * c.log_likelihood_gain for e, c in found.candidates.items() if c.used}
    values = {e: spread_to(loglik(found.candidates[e].fit) - loglik(found.base), g) for e, g in gains.items()}
    if "outliers" not in s.proven and found.log_likelihood_gains["outliers"] > 0.0:
        gains["outliers"] = found.log_likelihood_gains["outliers"]
        values["outliers"] = spread_to(spikes(found), gains["outliers"])
    best = {}
    for e in sorted(gains, key=lambda e: gains[e]):
        if gains[e] > 0.0 and block_of(e) not in settled:
            best[block_of(e)] = e
    if not best:
        return
    blocks = list(best)
    sums = pick.sums(np.stack([values[e] for e in best.values()]))
    owned = [{b: np.maximum(sums[i], 0.0)} for i, b in enumerate(blocks)]
    scores = [sums[i] for i in range(len(blocks))]
    pair = [e for e in found.chosen if e in gains and block_of(e) not in settled]
    for first, second, joint in _pairs(found, pair, gains, values, settled) if len(pair) == 2 else ():
        alone, other, both = np.maximum(pick.sums(np.stack([values[first], values[second], joint])), 0.0)
        # Shapley's value of two: each one's mean over both orders of joining
        one, two = np.maximum(alone + both - other, 0.0), np.maximum(other + both - alone, 0.0)
        whole = np.where(one + two > 0.0, one + two, 1.0)
        owned.append({block_of(first): both * one / whole, block_of(second): both * two / whole})
        scores.append(pick.sums(joint))
    table = np.stack([np.full(DRAWS + 1, level), *scores])
    weight = np.exp(table - table.max(axis=0))
    weight /= weight.sum(axis=0)
    told.draws[-1] += weight[0] * level
    for w, part in zip(weight[1:], owned):
        for b, nats in part.items():
            told.add(b, w * nats)
    for b, e in best.items():
        named = next((c for c in pair if block_of(c) == b), e)
        told.says[b].append(named)


def _pairs(
    found: Assessment, pair: list[str], gains: dict[str, float], values: dict[str, np.ndarray], settled: set[str]
) -> Iterable[tuple[str, str, np.ndarray]]:
    """Yield the two named effects, and each other block's best in the second one's place, with what both bring together."""
    first, second = pair
    fitted = first in found.candidates and second in found.candidates
    joint = loglik(found.final) - loglik(found.base) if fitted else values[first] + values[second]
    rivals = {}
    for e, gain in sorted(found.log_likelihood_gains_on_top.items(), key=lambda t: t[1]):
        if gain > SECOND and e in values and block_of(e) not in settled | {block_of(first), block_of(second)}:
            rivals[block_of(e)] = e
    for e in (second, *rivals.values()):
        # a rival was fitted beside the first, but only its sum was kept
        yield (
            first,
            e,
            spread_to(joint + values[e] - values[second], gains[first] + found.log_likelihood_gains_on_top.get(e, gains[e])),
        )


def _allowed(found: Assessment, effect: str, fit: Fit) -> float:
    """Return the factor by which friction that a healthy valve may have is discounted."""
    friction = effect in ("stiction", "deadband") and found.situation.trusted
    return beyond_healthy(fit.theta["S"]) if friction and found.candidates[effect].log_likelihood_gain > 0.0 else 1.0


def _strange(found: Assessment, rng: np.random.Generator, told: _Told) -> None:
    """Count what the best model's residual tests leave in a block, a chi-square in excess of its degrees of freedom."""
    for block in found.unexplained:
        nats, degrees = 0.0, 0
        for name, (_, owner) in LIMITS.items():
            if owner == block and name in found.tests:
                d = DEGREES.get(name, 2)
                value = found.tests[name] if name.endswith("nats") else found.tests[name] * np.sqrt(d / 2.0)
                nats, degrees = nats + max(value, 0.0), degrees + d
        if nats > 0.0 and not told.draws[BLOCKS.index(block), 0] > nats:
            spread = np.sqrt(2.0 * nats + 0.5 * degrees) * np.append(0.0, rng.standard_normal(DRAWS))
            told.add(block, np.maximum(nats + spread, 0.0))


def _unplaced(block: str, found: Assessment) -> Where:
    return Where({b: BlockShare(float(b == block), 0.0, 1.0, _sentence(b, found, [], 0.0)) for b in BLOCKS})


def _words(effects: Iterable[str]) -> str:
    return " and ".join(e.replace("_", " ") for e in effects)


def _sentence(block: str, found: Assessment, says: list[str], share: float) -> str:
    """Return what the block shows when it is driven with the recorded signal in front of it."""
    s = found.situation
    what = _words(dict.fromkeys(says))
    if block in found.unexplained:
        what = f"{what}; {found.unexplained[block]}" if what else found.unexplained[block]
    if block == "controller":
        if s.unexplained_law:
            return f"Driven with the recorded error: {s.unexplained_law}."
        if s.law.reason and not what:
            return f"Driven with the recorded error it cannot be judged: {s.law.reason}."
        missed = 100.0 * np.sqrt(min(law_residuals(s)[2], 1.0))
        if missed < 0.05 and not what:
            return "Driven with the recorded error, the baseline's law gives the recorded OP."
        left = f"Driven with the recorded error, the baseline's law misses {missed:.2g} % of OP's changes"
        return f"{left}{': ' + what if what else ''}."
    if block == "valve" and s.record.mv is not None:
        rms = float(np.std(np.asarray(s.record.mv) - np.clip(s.op, 0.0, 100.0)))
        left = f"Driven with OP, an ideal valve misses MV by {rms:.2g} % of travel rms"
        own = next((e for e in says if e in EFFECTS), "")
        if not own:
            return f"{left}."
        return f"{left}; {_words([own])} leaves {np.std(mv_residuals(s, own, found.parameters[own])[1]):.2g} %."
    if block == "sensor" and (s.frozen or any(block_of(e) == "sensor" for e in s.proven)):
        return f"Single samples of PV show: {what or 'a standstill'}."
    driver = "OP" if s.record.mv is None else "MV"
    own = next((e for e in says if e in found.candidates or e == "outliers"), "")
    beside = next((e for e in found.chosen if block_of(e) == block and e in found.log_likelihood_gains_on_top), "")
    if not own and beside and share > 0.0:
        gain, first = found.log_likelihood_gains_on_top[beside], _words(e for e in found.chosen if e != beside)
        return f"Driven with {driver}, {_words([beside])} makes PV {gain:.0f} nats likelier once {first} is in."
    if not own:
        return f"Driven with {driver}, nothing freed in it predicts PV better{'; ' + what if what else ''}."
    gain = found.candidates[own].log_likelihood_gain if own in found.candidates else found.log_likelihood_gains[own]
    smaller = 100.0 * (1.0 - np.exp(-max(gain, 0.0) / s.record.n))
    better = f"makes PV {gain:.0f} nats likelier, as a one-step error {smaller:.2g} % smaller would"
    elsewhere = "; another block explains the same better" if share < 0.05 and gain > FAINT else ""
    return f"Driven with {driver}, {what} {better}{elsewhere}."
