"""Twenty sites with nuisances on which the diagnosis stumbled in another author's hands: filters
that the loop file states, behind noise that is coloured in part; external reset; OP archived a
sample late; plants whose gain bends with the load; and two faults more.

The rest of their habits is drawn as those of `recipes`, and the machine is the refinery's.
"""

from __future__ import annotations

import numpy as np

from results.studies.worlds import recipes
from results.studies.worlds.recipes import drawn_at, part, simulate, site_at, site_of, test
from results.studies.worlds.refinery.drawing import Item
from results.studies.worlds.refinery.foreign import EVERY as FOREIGN
from results.studies.worlds.refinery.loops import Habits

TITLE = "nuisances: twenty sites with what the diagnosis stumbled over in another author's hands"
_STREAM = 97  # of the random numbers that make a site

__all__ = ["FOREIGN", "TITLE", "Item", "draw", "part", "simulate", "site_at", "site_of", "test"]


def draw(seed: int, index: int, entry: dict) -> Item:
    """Draw one labelled record of the site that has its number."""
    return drawn_at(site, seed, index, entry)


def site(number: int) -> Habits:
    """Return the habits of a site; the same for every seed.

    >>> site(3) == site(3), site(3).reset == recipes.site(3).reset
    (True, False)
    """
    rng = np.random.default_rng([_STREAM, number])
    # of the numbers beyond those of `recipes`
    return recipes.site(recipes.SITES + number)._replace(
        late=float(rng.uniform(0.2, 1.0)),
        filter=float(rng.uniform(0.05, 0.3)),
        filter_stated=float(rng.uniform(0.3, 1.0)),
        share=float(rng.uniform(0.05, 0.4)),
        reset=float(rng.uniform(0.2, 0.8)),
        bend=float(rng.uniform(0.0, 0.02)),
    )
