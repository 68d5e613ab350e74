"""Search for an empirical model block by block: fit on the first part of a record, keep only what
improves the rest.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from simbench.gap.discover.families import (
    Nulls,
    Tried,
    families,
    fitted,
    gain_of,
    judged,
    nulls_of,
    worth,
)
from simbench.gap.discover.valve import valve_law
from simbench.gap.exact import controller_law, sensor_law
from simbench.gap.law import FoundLaw, spells_of
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, input_gain
from simbench.gap.likelihood.residual_tests import of_load
from simbench.gap.situation import Situation, load_memory
from simbench.loop.laws import LAW_FORMS
from simbench.progress import Progress

_TRIED = 24  # forms asked of a record: the price of having asked so many questions (Bonferroni)
_CHANCE = 0.01  # of a law where none holds, above which it is not believed ...
_LEAST_NATS = float(np.log(_TRIED / _CHANCE))  # ... in nats on unseen samples
_JUDGED = 4  # families, the likeliest on the first part, that are asked on the rest
_LEARNT = 5.0  # nats that a family must bring to the samples it was fitted to
_SPELL = 10.0  # mean length (samples) from which spells are believed
_LOUD = 1.6  # times the size of the quiet innovations, from which others are loud
_CREDIBLE = 1.92  # nats within which a number may lie: half the 95 % point of chi-squared
_STEPS = (0.003, 0.01, 0.03, 0.1, 0.2, 0.4, 0.8)  # shares of a number, tried for its interval
_PRICE = 6.0  # nats of a change from on to off


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


def search(s: Situation, first: int, progress: bool = False) -> Finding:
    """Return the law of a record, learnt on samples before `first` and judged by those from there
    on.
    """
    with Progress(total=16, desc="laws", disable=not progress, leave=False) as bar:
        learn = Engine(_part(s.data, 0, first), load_memory(s))
        nulls = nulls_of(learn)
        null = max(nulls, key=worth)[0]
        bar.update(3)
        for find in (controller_law, sensor_law, valve_law):
            law = find(s, first)
            bar.update()
            if law is not None and law.nats > _LEAST_NATS:
                return Finding(law, null, null, block=law.block)
        shown = [("controller", s.unexplained_law)] if s.unexplained_law else [*s.facts.values()]
        shown += [("sensor", "PV stands still while OP moves")] if s.frozen else []
        block, words = max(shown, key=lambda one: one[0] == "controller", default=("", ""))
        if block == "controller":
            return Finding(None, null, null, f"{words}, and no form describes how", block)
        finding = _by_likelihood(s, learn, nulls, first, bar)
    if finding.law is not None or not words:
        return finding
    return finding._replace(why=f"{words}, and {finding.why}", block=block)


def _part(d: Data, begin: int, end: int) -> Data:
    return replace(d, u=d.u[begin:end].copy(), y=d.y[begin:end].copy())


def _by_likelihood(s: Situation, learn: Engine, nulls: Nulls, first: int, bar: Progress) -> Finding:
    """Return the law between OP and PV that pays, on top of the nulls or in the place of the load's
    jumps.
    """
    rest = Engine(_part(s.data, first, s.data.n), load_memory(s))
    others = nulls_of(rest)
    null, other = max(nulls, key=worth)[0], max(others, key=worth)[0]
    level = max(map(worth, nulls))
    bar.update(2)
    tries: list[tuple[float, Tried]] = []
    for family in families(s, first):
        laws = [(price, fitted(family, learn, base)) for base, price in nulls]
        tries += [
            (gain_of(law, learn, level + price), law) for price, law in laws if law is not None
        ]
        bar.update()
    forms = tuple((LAW_FORMS[law.family.form].block, gain) for gain, law in tries)
    tries = sorted((t for t in tries if t[0] > _LEARNT), key=lambda t: -t[0])
    laws_that_pay: list[tuple[float, FoundLaw, Fit]] = []
    most = 0.0
    for gain, law in tries[:_JUDGED]:
        there, held = judged(law, rest, others)
        nats = held - float(np.log(2.0))
        if nats <= _LEAST_NATS:
            # the other way round too, and the mean of both ratios (Wasserman, Ramdas & Balakrishnan
            # 2020, cross-fit)
            back = [
                one
                for base, _ in others
                for one in [fitted(law.family, rest, base)]
                if one is not None
            ]
            there_too = max(back, key=lambda one: one.fit.loglik, default=law)
            nats = float(
                np.logaddexp(held, judged(there_too, learn, nulls)[1] if back else -np.inf)
            ) - float(np.log(2.0))
        most = max(most, nats)
        if nats > _LEAST_NATS:
            evidence = np.append(_evidence(law.fit, null, gain), _evidence(there, other, held))
            known = FoundLaw(
                law.family.form,
                law.numbers,
                float(nats),
                evidence,
                intervals=_intervals(law, learn),
            )
            laws_that_pay.append((gain + nats, known, law.fit))
    # jumps of the load would take its spells for theirs
    loud = _loud(s, nulls[0][0], others[0][0], first)
    if loud is not None:
        forms = (*forms, (loud[0].block, loud[0].nats))
        if loud[0].nats > _LEAST_NATS:
            laws_that_pay.append((2.0 * loud[0].nats, *loud))
    if not laws_that_pay:
        why = (
            f"no form pays on samples that it was not fitted to (best {most:.1f}, needed"
            f" {_LEAST_NATS:.0f} nats)"
        )
        return Finding(None, null, null, why, forms=forms)
    _, best, fit = max(laws_that_pay, key=lambda t: t[0])
    return Finding(best, null, fit, forms=forms)


def _intervals(law: Tried, engine: Engine) -> dict[str, tuple[float, float]]:
    """Return the values of each number within two nats of its best, the others held."""
    fit, out = law.fit, {}

    def loss(name: str, value: float) -> float:
        return fit.loglik - engine.evaluate(fit.spec, {**fit.theta, name: value})[0]

    for name, best in law.engine_numbers.items():
        reached = [best, best]
        for side, way in enumerate((-1.0, 1.0)):
            for share in _STEPS:
                reached[side] = best + way * share * (abs(best) or 1.0)
                if loss(name, reached[side]) > _CREDIBLE:
                    break
        for value in reached:
            for key, number in law.family.numbers(law.engine_numbers | {name: value}).items():
                low, high = out.get(key, (number, number))
                out[key] = (min(low, number), max(high, number))
    return out


def _evidence(fit: Fit, null: Fit, gain: float) -> np.ndarray:
    """Return by how much each sample speaks for a fit over its null; what is no square is shared
    by all.
    """
    squares = 0.5 * (np.asarray(null.residual) ** 2 - np.asarray(fit.residual) ** 2)
    return squares + (gain - float(squares.sum())) / squares.size


def _loud(s: Situation, null: Fit, other: Fit, first: int) -> tuple[FoundLaw, Fit] | None:
    """Return the law of a load, or of noise, that is strong in spells, by two sizes of the
    innovations, and the quiet fit.
    """
    r = np.concatenate([np.asarray(null.residual), np.asarray(other.residual)])
    r = np.clip(r, -8.0, 8.0)
    learn = r[:first]
    quiet, loud = float(np.quantile(np.abs(learn), 0.3)) / 0.385, 2.0 * float(np.std(learn))
    on = np.zeros(first, dtype=bool)
    for _ in range(6):
        on = spells_of(_louder(learn, quiet, loud), _PRICE)
        if not 0.02 < on.mean() < 0.9:
            return None
        quiet, loud = float(np.std(learn[~on])), float(np.std(learn[on]))
    evidence = _louder(r, quiet, loud)
    on = spells_of(evidence, _PRICE)
    judge, changes = slice(first, None), np.abs(np.diff(on[first:].astype(int))).sum()
    share = min(float(on.mean()), 0.95)
    # without spells: innovations of one size, or as often loud as in the spells but at any time
    one_size = _louder(r[judge], quiet, float(np.std(r[judge])) + 1e-9)
    any_time = np.logaddexp(np.log1p(-share), np.log(share + 1e-9) + evidence[judge])
    plain = max(float(one_size.sum()), float(any_time.sum()))
    nats = float(evidence[judge][on[judge]].sum()) - plain - _PRICE * float(changes + 1)
    runs = max(int(np.sum(np.diff(on.astype(int)) == 1)), 1)
    length = float(on.sum()) / runs
    if loud < _LOUD * quiet or length < _SPELL or nats <= 0.0:
        return None
    Ts, theta = s.record.Ts, null.theta
    numbers = {"share": share, "length": length * Ts}
    more = float(np.sqrt(max(loud**2 - quiet**2, 0.0)))
    if of_load(learn, np.flatnonzero(on[:first]), null) and theta["load"] > 0.0:
        load = {
            "std": min(more * theta["load"] / abs(input_gain(null, s.data)), 100.0),
            "time": theta["load_time"] * Ts,
        }
        law = FoundLaw("bursts", load | numbers, nats, evidence=evidence, on=on)
        return law, replace(null, theta={**theta, "load": quiet * theta["load"]})
    return (
        FoundLaw(
            "rough",
            {"std": more / quiet * theta["noise_std"]} | numbers,
            nats,
            evidence=evidence,
            on=on,
        ),
        null,
    )


def _louder(r: np.ndarray, quiet: float, loud: float) -> np.ndarray:
    """Return by how much each sample speaks for the louder of two normal sizes."""
    return np.log(quiet / loud) + 0.5 * r * r * (quiet**-2.0 - loud**-2.0)


def where(law: FoundLaw) -> np.ndarray:
    """Return the samples (n,) in which a law acts: its spells, or where the samples speak for
    it and the others against.
    """
    if law.on is not None:
        return law.on
    evidence = np.asarray(law.evidence)
    on = spells_of(evidence, _PRICE)
    against = float(evidence[~on].sum())
    return on if against < -2.0 * _PRICE and on.mean() < 0.9 else np.ones(evidence.size, dtype=bool)
