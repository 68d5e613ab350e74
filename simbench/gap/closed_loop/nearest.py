"""Choose among the loops that may copy a record the one whose simulations are nearest to the part
that was fitted.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from simbench.gap.closed_loop.copies import Copy, archived
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import run_with_seeds
from simbench.gap.closed_loop.summary_features import (
    distance,
    features,
    least_spread,
    seed_spread,
)
from simbench.gap.situation import Situation

_SEEDS = 16  # simulations of each
_FROM = 0.3  # of the record: what lies before is the way from rest


class Near(NamedTuple):
    """The loop that copies a record, what it is made of, whether its archive repeats samples, and
    how far its simulations are from the fitted part.
    """

    copy: Copy
    held: bool
    distance: float


def nearest(s: Situation, tried: Iterable[Copy], seed: int = 0) -> Near | None:
    """Return the copy of a record whose simulations are nearest to it between 30 and 65 %, of
    copies as near the plainest; None where none can be simulated.
    """
    end = held_out(s)
    part = slice(int(_FROM * s.record.n), end)
    named = features(s.op[part], s.record.pv[part], s.sp[part])
    real, least = np.array(list(named.values())), least_spread(named, part.stop - part.start)
    found: list[Near] = []
    repeats = any(np.any(np.diff(x) == 0.0) for x in (s.op, s.record.pv))
    for copy in tried:
        for held in (False, True) if repeats else (False,):
            loop = archived(copy.loop, s, held)
            records = run_with_seeds(loop.with_("sampling.n", end), seed, _SEEDS)
            if records is None:
                continue
            op, pv = (np.array([getattr(r, x)[part] for r in records]) for x in ("op", "pv"))
            runs = np.array(list(features(op, pv, s.sp[part]).values())).T
            away = distance(real, runs, seed_spread(runs, least))
            found.append(Near(copy._replace(loop=loop), held, away))
    return min(found, key=lambda near: near.distance, default=None)
