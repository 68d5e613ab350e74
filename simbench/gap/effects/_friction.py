"""What stiction and dead-band share: when the two look alike."""

from __future__ import annotations

from simbench.gap.situation import Circumstances


def jitter_hides_the_jump(c: Circumstances) -> bool:
    """Return whether OP jitters by more than the valve jumps, so that a jump does not show."""
    return c.slip is not None and c.op_jitter > c.slip and not c.mv
