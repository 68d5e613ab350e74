"""Search for an empirical model block by block: fit on the first part of a record, keep only what
improves the rest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from simbench.detectors.signal.holds import runs_of
from simbench.gap.discover.families import Tried, families, fitted, held
from simbench.gap.discover.valve import valve_law
from simbench.gap.exact import controller_law, sensor_law
from simbench.gap.law import FoundLaw, spells_of
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, input_gain
from simbench.gap.likelihood.residual_tests import of_load
from simbench.gap.situation import Situation, load_memory
from simbench.loop.laws import LAW_FORMS

_TRIED = 24  # forms asked of a record: the price of having asked so many questions (Bonferroni)
_CHANCE = 0.01  # of a law where none holds, above which it is not believed ...
_LEAST_NATS = float(np.log(_TRIED / _CHANCE))  # ... in nats on unseen samples
_JUDGED = 4  # families, the likeliest on the first part, that are asked on the rest
_LEARNT = 5.0  # nats that a family must bring to the samples it was fitted to
_SPELL = 10.0  # mean length (samples) from which spells are believed
_LOUD = 1.6  # times the size of the quiet innovations, from which others are loud
_DRAWS = 40  # fits drawn for the intervals of a law's numbers
_PRICE = 6.0  # nats of a change from on to off


# laws that need no likelihood between OP and PV
FINDERS = (controller_law, sensor_law, valve_law)


class Finding(NamedTuple):
    """The law, its fit to the first part and the fit without it; None where no law pays, then why.

    `block` is set where single samples, the controller's law or MV show it; `forms` are block and
    nats (on the first part) of what was tried by likelihood.
    """

    law: FoundLaw | None
    null: Fit
    fit: Fit
    why: str = ""
    block: str = ""
    forms: tuple[tuple[str, float], ...] = ()


def chance(nats: float) -> float:
    """Return the chance of so many nats on unseen samples by one of the forms where none holds.

    With its numbers held, a law's likelihood ratio on samples that it was not fitted to exceeds 1/p
    with a chance of at most p (Wasserman, Ramdas & Balakrishnan 2020); the forms share it equally.
    """
    return float(min(1.0, _TRIED * np.exp(-min(nats, 700.0))))


def search(s: Situation, first: int) -> Finding:
    """Return the law of a record, learnt on samples before `first` and judged by those from there
    on.
    """
    learn, rest = (
        Engine(replace(s.data, u=s.data.u[part], y=s.data.y[part]), load_memory(s))
        for part in (slice(first), slice(first, None))
    )
    null = learn.of_higher_order(learn.base())
    for find in FINDERS:
        law = find(s, first)
        if law is not None and law.nats > _LEAST_NATS:
            return Finding(law, null, null, block=law.block)
    shown = [("controller", s.unexplained_law)] if s.unexplained_law else [*s.facts.values()]
    shown += [("sensor", "PV stands still while OP moves")] if s.frozen else []
    block, words = max(shown, key=lambda one: one[0] == "controller", default=("", ""))
    if block == "controller":
        return Finding(None, null, null, f"{words}, and no form describes how", block)
    finding = _by_likelihood(s, learn, rest, null, first)
    if finding.law is not None or not words:
        return finding
    return finding._replace(why=f"{words}, and {finding.why}", block=block)


def _by_likelihood(s: Situation, learn: Engine, rest: Engine, null: Fit, first: int) -> Finding:
    """Return the law between OP and PV, or of spells, that pays."""
    other = rest.of_higher_order(rest.base())
    laws = [fitted(family, learn, null) for family in families(s, first)]
    laws.sort(key=lambda law: -law.gain)
    forms = [(LAW_FORMS[law.family.form].block, law.gain) for law in laws]
    paying: list[tuple[float, FoundLaw, Fit]] = []
    most = 0.0
    for law in laws[:_JUDGED]:
        if law.gain <= _LEARNT:
            break
        nats = held(law, rest, other).loglik - other.loglik
        most = max(most, nats)
        if nats > _LEAST_NATS:
            found = FoundLaw(
                law.family.form, law.family.numbers(law.fit), nats, intervals=_intervals(law, learn)
            )
            paying.append((law.gain + nats, found, law.fit))
    loud = _loud(s, null, other, first)
    if loud is not None:
        forms.append((loud[0].block, loud[0].nats))
        if loud[0].nats > _LEAST_NATS:
            paying.append((2.0 * loud[0].nats, *loud))
    if not paying:
        why = (
            f"no form pays on samples that it was not fitted to (best {most:.1f}, needed"
            f" {_LEAST_NATS:.0f} nats)"
        )
        return Finding(None, null, null, why, forms=tuple(forms))
    _, best, fit = max(paying, key=lambda law: law[0])
    return Finding(best, null, fit, forms=tuple(forms))


def _intervals(law: Tried, engine: Engine) -> dict[str, tuple[float, float]]:
    """Return two standard deviations about each number, by the likelihood's curvature."""
    drawn = engine.scattered(law.fit, _DRAWS, 1.0, np.random.default_rng(0))
    spread = [law.family.numbers(fit) for fit in drawn]
    ends = law.family.numbers(law.fit).items()
    wide = {k: 2.0 * float(np.std([one[k] for one in spread], ddof=1)) for k, _ in ends}
    return {k: (x - wide[k], x + wide[k]) for k, x in ends}


def _loud(s: Situation, null: Fit, other: Fit, first: int) -> tuple[FoundLaw, Fit] | None:
    """Return the law of a load, or of noise, that is strong in spells, by two sizes of the
    innovations, and the quiet fit.
    """
    r = np.clip(np.append(null.residual, other.residual), -8.0, 8.0)
    learn, judge = r[:first], r[first:]
    quiet, loud = float(np.quantile(np.abs(learn), 0.3)) / 0.385, 2.0 * float(learn.std())
    on = np.zeros(first, dtype=bool)
    for _ in range(6):
        on = spells_of(_louder(learn, quiet, loud), _PRICE)
        if not 0.02 < on.mean() < 0.9:
            return None
        quiet, loud = float(learn[~on].std()), float(learn[on].std())
    on = spells_of(_louder(r, quiet, loud), _PRICE)
    share, length = min(float(on.mean()), 0.95), float(on.sum()) / max(len(runs_of(on)), 1)
    evidence, late = _louder(judge, quiet, loud), on[first:]
    # without spells: innovations of one size, or as often loud as in the spells but at any time
    one_size = _louder(judge, quiet, judge.std() + 1e-9)
    any_time = np.logaddexp(np.log1p(-share), np.log(share + 1e-9) + evidence)
    changes = np.count_nonzero(np.diff(late)) + 1
    nats = float(evidence[late].sum() - max(one_size.sum(), any_time.sum()) - _PRICE * changes)
    if loud < _LOUD * quiet or length < _SPELL or nats <= 0.0:
        return None
    Ts, theta, more = s.record.Ts, null.theta, float(np.sqrt(loud**2 - quiet**2))
    spells = {"share": share, "length": length * Ts}
    if theta["load"] <= 0.0 or not of_load(learn, np.flatnonzero(on[:first]), null):
        std = more / quiet * theta["noise_std"]
        return FoundLaw("rough", {"std": std, **spells}, nats, on=on), null
    std = min(more * theta["load"] / abs(input_gain(null, s.data)), 100.0)
    numbers = {"std": std, "time": theta["load_time"] * Ts, **spells}
    fit = replace(null, theta={**theta, "load": quiet * theta["load"]})
    return FoundLaw("bursts", numbers, nats, on=on), fit


def _louder(r: np.ndarray, quiet: float, loud: float) -> np.ndarray:
    """Return by how much each sample speaks for the louder of two normal sizes."""
    return np.log(quiet / loud) + 0.5 * r * r * (quiet**-2.0 - loud**-2.0)
