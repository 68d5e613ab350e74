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

    Taking the plainest within 5 or 10 % of the nearest left .73 and .75 of 79 records near, not
    .76 (results/gap_real.txt).
    """
    end = held_out(s)
    part = slice(int(_FROM * s.record.n), end)
    named = features(s.op[part], s.record.pv[part], s.sp[part])
    real, least = np.array(list(named.values())), least_spread(named, part.stop - part.start)
    found: list[Near] = []
    for copy in tried:
        for held in (False, True):
            loop = archived(copy.loop, s, held)
            short = loop.with_("sampling.n", end)
            records = run_with_seeds(short, seed, _SEEDS)
            if records is None or (held and not _holds(loop)):
                continue
            op, pv = (np.array([getattr(r, x)[part] for r in records]) for x in ("op", "pv"))
            runs = np.array(list(features(op, pv, s.sp[part]).values())).T
            away = distance(real, runs, seed_spread(runs, least))
            found.append(Near(copy._replace(loop=loop), held, away))
    return min(found, key=lambda near: near.distance, default=None)


def _holds(loop) -> bool:
    """Return whether a loop's archive repeats samples."""
    return loop.archive is not None and bool(loop.archive.op_held or loop.archive.pv_held)
