"""Describe in words what a simulation does not reproduce of a record, wherever in it one looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.level import RUNS, run_with_seeds
from simbench.gap.closed_loop.summary_features import BANDS, features, seed_spread
from simbench.gap.situation import Situation
from simbench.scenarios.spec import Loop

_IN_SENTENCE = 3  # features put into words
_PLAIN = 3.0  # seed-to-seed standard deviations from which a feature differs
_WORDS = {
    "size": "swings {}",
    "change": "moves {} from sample to sample",
    "at rest": "stands still {} often",
    "straight": "runs on straight lines {} often",
    "at limit": "stands at an end {} often",
    "sharpness": "oscillates {} sharply",
    "wander": "wanders {}",
    "band": "moves {}",
    "op after pv": "OP follows PV otherwise",
    "pv after op": "PV follows OP otherwise",
}


@dataclass(frozen=True)
class Lacking:
    """Features in which a record differs from its simulation in every stretch of it, the plainest
    first, each as (words, seed-to-seed standard deviations).
    """

    features: tuple[tuple[str, float], ...]

    @property
    def sentence(self) -> str:
        """The plainest differences in words."""
        return ", ".join(
            f"{words} ({abs(size):.0f} standard deviations)"
            for words, size in self.features[:_IN_SENTENCE]
        )


def lacking(situation: Situation, loop: Loop, seed: int) -> Lacking | None:
    """Return what a record has and runs of a loop have not; None where the loop cannot be
    simulated.
    """
    records = run_with_seeds(loop, seed, RUNS)
    if records is None:
        return None
    both = [(situation.op, situation.record.pv)]
    both += [as_archived(situation, r.op, r.pv) for r in records]
    signals, length = np.array(both), situation.record.n // 3
    sizes, named = [], {}
    for i in range(3):
        part = slice(i * length, (i + 1) * length)
        # a baseline states nothing of the kind of its noise, nor of ordinary loads: no tails
        named = features(signals[:, 0, part], signals[:, 1, part], situation.sp[part])
        named = {name: x for name, x in named.items() if not name.endswith("kurtosis")}
        real, *sims = np.array([*named.values()]).T
        sizes.append((real - np.mean(sims, axis=0)) / seed_spread(np.array(sims)))
    # what differs in every stretch, in the same direction
    same = np.all(np.sign(sizes) == np.sign(sizes[0]), axis=0)
    least = np.where(same, np.min(np.abs(sizes), axis=0), 0.0) * np.sign(sizes[0])
    differing = [(name, float(z)) for name, z in zip(named, least) if abs(z) > _PLAIN]
    differing.sort(key=lambda f: -abs(f[1]))
    return Lacking(tuple((_in_words(name, z, situation, length), z) for name, z in differing))


def _in_words(name: str, z: float, s: Situation, length: int) -> str:
    # names are a signal, a feature and, of several of a kind, a number
    kind, _, number = name.rpartition(" ") if name[-1].isdigit() else (name, "", "")
    signal, _, what = kind.partition(" ")
    if "after" in what:
        return _WORDS[kind]
    if what == "memory":
        words = f"remembers {'longer' if z > 0 else 'less'} over {int(number) * s.record.Ts:.3g} s"
        return f"{signal.upper()} {words}"
    words = _WORDS[what].format("more" if z > 0 else "less")
    if what == "band":
        periods = length * s.record.Ts / np.geomspace(2, length // 2 + 1, BANDS + 1)
        short, long = periods[int(number)], periods[int(number) - 1]
        words += f" at periods of {short:.3g} to {long:.3g} s"
    return f"{signal.upper()} {words}"
