"""Describe in words what a simulation does not reproduce of a record, wherever in it one looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.spec import Loop
from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.level import RUNS, run_with_seeds
from simbench.gap.closed_loop.summary_features import BANDS, features, seed_spread
from simbench.gap.situation import Situation

_IN_SENTENCE = 3  # features put into words
_PLAIN = 3.0  # seed-to-seed standard deviations from which a feature differs
_WORDS = {
    "size": ("swings more", "swings less"),
    "change": ("moves more from sample to sample", "moves less from sample to sample"),
    "at rest": ("stands still more often", "stands still less often"),
    "straight": ("runs on straight lines more often", "runs on straight lines less often"),
    "at limit": ("stands at an end more often", "stands at an end less often"),
    "sharpness": ("oscillates more sharply", "oscillates less sharply"),
    "wander": ("wanders more", "wanders less"),
    "memory": ("remembers longer", "remembers less"),
    "band": ("moves more", "moves less"),
}
_LINKS = {"op after pv": "OP follows PV otherwise", "pv after op": "PV follows OP otherwise"}


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
    sizes, names = [], []
    for part in (slice(i * length, (i + 1) * length) for i in range(3)):
        op, pv = signals[:, 0, part], signals[:, 1, part]
        # a baseline states nothing of the kind of its noise, nor of ordinary loads: no tails
        named = features(op, pv, situation.sp[part]).items()
        names = [name for name, _ in named if not name.endswith("kurtosis")]
        real, *sims = np.array([x for name, x in named if name in names]).T
        sizes.append((real - np.mean(sims, axis=0)) / seed_spread(np.array(sims)))
    # what differs in every stretch, in the same direction
    same = np.all(np.sign(sizes) == np.sign(sizes[0]), axis=0)
    least = np.where(same, np.min(np.abs(sizes), axis=0), 0.0) * np.sign(sizes[0])
    differing = [(name, float(z)) for name, z in zip(names, least) if abs(z) > _PLAIN]
    differing.sort(key=lambda f: -abs(f[1]))
    return Lacking(tuple((_in_words(name, z, situation, length), z) for name, z in differing))


def _in_words(name: str, z: float, s: Situation, length: int) -> str:
    for link, words in _LINKS.items():
        if name.startswith(link):
            return words
    signal, _, what = name.partition(" ")
    kind, _, number = what.partition(" ") if what.startswith(("band", "memory")) else (what, "", "")
    words = _WORDS[kind][0 if z > 0 else 1]
    if kind == "band":
        periods = length * s.record.Ts / np.geomspace(2, length // 2 + 1, BANDS + 1)
        short, long = periods[int(number)], periods[int(number) - 1]
        words += f" at periods of {short:.3g} to {long:.3g} s"
    elif kind == "memory":
        words += f" over {int(number) * s.record.Ts:.3g} s"
    return f"{signal.upper()} {words}"
