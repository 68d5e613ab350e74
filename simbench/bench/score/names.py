"""Names of what a score is of: populations, reference rows, kinds of methods."""

from __future__ import annotations

from simbench.detectors.verdict import NO_STICTION, STICTION

ALL = "all"
OF_OSCILLATING, OF_NOT_OSCILLATING = "oscillating", "not oscillating"
SAMPLED = "sampled"  # scenarios of a large run on which orders and scatter are worked out
LEAST = 20  # loops: a rate of fewer says nothing, and is not shown
ROLE_YARDSTICK = "yardstick"
CONSTANTS = {"always_no": NO_STICTION, "always_yes": STICTION}  # rows that always say the same
# reference rows that know everything but the waveform; the second also how regular the cycles are
NO_WAVEFORM, WITH_RHYTHM = "no_waveform", "rhythm"
# after a method's name, by where its constants were fitted: on loops of this grid, on loops like
# most of these, on neither
HOME_MARKS = {"fitted here": "*", "siblings": "+", "no": ""}


def kind_of(role: str, sees_mv: bool) -> int:
    """Return 0 for a stiction method on OP and PV, 1 for one that sees MV, 2 for yardsticks and the
    oracle, 3 for other tests.
    """
    if role in ("oracle", ROLE_YARDSTICK):
        return 2
    return 3 if role == "nonlinearity" else int(sees_mv)
