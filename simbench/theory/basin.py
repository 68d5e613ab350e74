"""Which kicks start the limit cycle: scan, then bisection."""

from __future__ import annotations

import numpy as np

from simbench.theory.cycle import ExactCycle, at_rest
from simbench.theory.march import reversals
from simbench.theory.sampled import SampledLoop

_RATIO = 1.02  # of neighbouring kicks in the scan
_ROUNDS = 14  # blocks of half cycles a kick may take to settle
REVERSALS_WATCHED = 30


def starts_cycle(loop: SampledLoop, cycle: ExactCycle, kick: float) -> bool:
    """Whether a loop at rest ends in its limit cycle when OP is offset by `kick` at sample 0."""
    return reaches_cycle(loop, cycle, at_rest(loop, kick))


def reaches_cycle(loop: SampledLoop, cycle: ExactCycle, state: tuple) -> bool:
    """Whether the march from a state (x, s, past) ends in the limit cycle; the state is used up."""
    # The same cycle twice in a row is the limit cycle
    near = 0
    for _ in range(_ROUNDS):
        run = reversals(loop, *state, REVERSALS_WATCHED)
        if run.count < REVERSALS_WATCHED:
            return False
        period = 2 * np.diff(run.sample).mean() * loop.Ts
        swing = np.abs(np.diff(run.stop)).mean()
        if abs(period / cycle.period - 1) < 0.15 and abs(swing / cycle.swing - 1) < 0.25:
            near = near + 1
        else:
            near = 0
        if near == 2:
            return True
    return False


def kicks_text(loop: SampledLoop, cycle: ExactCycle, least: float) -> str:
    """Say which offsets of OP start the cycle, of a scan from the least one to the limit of OP."""
    scan = least * _RATIO ** np.arange(int(np.log(loop.hi / least) / np.log(_RATIO)) + 1)
    starting = []
    for kick in scan:
        if starts_cycle(loop, cycle, kick):
            starting.append(kick)
    tried = f"{least:.4g} to {scan[-1]:.4g} %"
    if len(starting) == len(scan):
        return f"every offset of OP tried, {tried}, starts the cycle"
    said = f"of {len(scan)} offsets of OP tried, {tried}, {len(starting)} start the cycle"
    return said + (f", none above {starting[-1]:.4g} %" if starting[-1] < scan[-1] else "")


def kick_min(loop: SampledLoop, cycle: ExactCycle) -> float | None:
    """Return the smallest kick (%) that starts the limit cycle from rest, or None when none within
    the limits of OP does.

    The scan grows by 2 % from the break-away S/2 + J/2, below which nothing moves. A start counts
    when the next kick of the scan starts the cycle too: the basin of an irregular cycle has fringes
    of isolated kicks, which no one could apply on purpose. Larger kicks may fail again.
    """
    # Kicks from the static friction to the end of travel, each a little larger
    if not 0 < loop.fs < loop.hi:
        return None
    scan = (
        loop.fs * 1.0005 * _RATIO ** np.arange(int(np.log(loop.hi / loop.fs) / np.log(_RATIO)) + 1)
    )

    # Two that start the cycle in a row; the smallest lies before the first
    before = False
    for i, kick in enumerate(scan):
        now = starts_cycle(loop, cycle, kick)
        if now and before:
            if i > 1:
                low = scan[i - 2]
            else:
                low = loop.fs
            high = scan[i - 1]

            # By halving, to a thousandth
            while high - low > 1e-3 * high:
                middle = 0.5 * (low + high)
                if starts_cycle(loop, cycle, middle):
                    high = middle
                else:
                    low = middle
            return float(high)
        before = now
    return None
