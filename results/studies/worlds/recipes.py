"""Twenty sites, each with habits of its own, drawn at random: order of the plants, instruments,
noise, loads, archive, clock, controllers, and how well the baseline knows them.

A record's number gives its site, so that records of every kind come from all of them. Even sites
are to build on, odd ones to judge by (`part`): what is tuned on the first is measured on the
others. The machine is the refinery's; its effects and faults are drawn as there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from results.studies.worlds.refinery import drawing
from results.studies.worlds.refinery.drawing import Item, simulate, test
from results.studies.worlds.refinery.foreign import FOREIGN
from results.studies.worlds.refinery.loops import Habits

TITLE = "recipes: twenty sites whose ordinary loops differ in everything that a baseline leaves out"
SITES = 20
_STREAM = 96  # of the random numbers that make a site

__all__ = ["FOREIGN", "TITLE", "Item", "draw", "part", "simulate", "site_of", "test"]


def draw(seed: int, index: int, entry: dict) -> Item:
    """Draw one labelled record of the site that has its number."""
    return drawn_at(site, seed, index, entry)


def drawn_at(habits_of: Callable[[int], Habits], seed: int, index: int, entry: dict) -> Item:
    """Draw one labelled record of the site that has its number, whose habits are given."""
    number = site_at(index)
    item = drawing.draw(seed, index, entry, habits_of(number))
    item.answer["case"]["site"] = number
    return item


def site_at(index: int) -> int:
    """Return the site of a record: each comes once in twenty records, in an order that agrees with
    no other pattern in a plan (every other record has MV).
    """
    turn, place = divmod(index, SITES)
    return int(np.random.default_rng([_STREAM, SITES, turn]).permutation(SITES)[place])


def site(number: int) -> Habits:
    """Return the habits of a site; the same for every seed.

    >>> site(3) == site(3), site(3) == site(4)
    (True, False)
    """
    rng = np.random.default_rng([_STREAM, number])

    def sometimes(p: float, most: float) -> float:
        return float(rng.uniform(0.2, 1.0) * most) if rng.random() < p else 0.0

    low = float(rng.uniform(0.02, 0.2))
    phi = float(rng.uniform(0.0, 0.6))
    return Habits(
        loads=_mixture(rng, 6),
        noises=_mixture(rng, 4),
        phi=(phi, phi + 0.3),
        higher_order=float(rng.uniform(0.0, 1.0)),
        lags=(low, low + float(rng.uniform(0.05, 0.25))),
        actuator=sometimes(0.6, 0.25),
        filter=sometimes(0.6, 0.25),
        integrating=float(rng.uniform(0.1, 0.6)),
        P=float(rng.uniform(0.0, 0.3)),
        PID=sometimes(0.6, 1.0),
        averaging=sometimes(0.3, 0.5),
        late=float(rng.uniform(0.0, 1.0)),
        exceptions=sometimes(0.5, 0.6),
        known_play=sometimes(0.4, 0.3),
        knows=float(rng.uniform(0.02, 0.1)),
        noise_known=sometimes(0.8, 0.1),
        load_told=sometimes(0.5, 1.0),
        jitter=sometimes(0.4, 0.05),
        lost=sometimes(0.4, 0.004),
    )


def _mixture(rng: np.random.Generator, kinds: int) -> tuple[float, ...]:
    """Return the weights of a few kinds, some of them next to 0."""
    return tuple(float(x) for x in 1e-6 + rng.dirichlet(np.full(kinds, 0.6)))


def site_of(answer: Mapping[str, Any]) -> int:
    """Return the number of the site that a record's answer names."""
    return int(answer["case"]["site"])


def part(site: int) -> str:
    """Return what the records of a site are for."""
    return "judge" if site % 2 else "build"
