"""What stiction and dead-band share: the size of a band, and when the two look alike."""

from __future__ import annotations

from collections.abc import Mapping

from simbench.gap.effects._size import LoopSize
from simbench.gap.situation import Circumstances


def jitter_hides_the_jump(c: Circumstances) -> bool:
    """Return whether OP jitters by more than the valve jumps, so that a jump does not show."""
    return c.slip is not None and c.op_jitter > c.slip and not c.mv


def band(p: Mapping[str, float | str], loop: LoopSize) -> dict[str, float]:
    """Return a band in proportion to the loop."""
    return {"size": loop.travel(p["S"])}
