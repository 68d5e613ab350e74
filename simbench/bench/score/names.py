"""Names of what a score is of: populations, reference rows, kinds of methods."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from simbench.detectors.verdict import NO_STICTION, STICTION

ALL = "all"
OF_OSCILLATING = "oscillating"
OF_NOT_OSCILLATING = "not oscillating"
SAMPLED = "sampled"  # scenarios of a large run on which orders and scatter are worked out
LEAST = 20  # loops: a rate of fewer says nothing, and is not shown
ROLE_YARDSTICK = "yardstick"
CONSTANTS = {"always_no": NO_STICTION, "always_yes": STICTION}  # rows that always say the same
# reference rows that know everything but the waveform; the second also how regular the cycles are
NO_WAVEFORM = "no_waveform"
WITH_RHYTHM = "rhythm"
# after a method's name, by where its constants were fitted: on loops of this grid, on loops like
# most of these, on neither
HOME_MARKS = {"fitted here": "*", "siblings": "+", "no": ""}


_GROUPS = (
    "",
    "with MV, ranked among themselves",
    "reference rows, not ranked",
    "nonlinearity tests, not ranked",
)


def kind_of(role: str, sees_mv: bool) -> int:
    """Return 0 for a stiction method on OP and PV, 1 for one that sees MV, 2 for yardsticks and the
    oracle, 3 for other tests.
    """
    if role in ("oracle", ROLE_YARDSTICK):
        return 2
    if role == "nonlinearity":
        return 3
    return int(sees_mv)


def group_of(row: Any, failing: Collection[str]) -> str:
    """Return what stands above the rows of a ranking that are not compared with its first ones, ""
    of these: from a row of `Scores.rows`.
    """
    if not row.partial:
        return _GROUPS[row.kind]
    if row.method in failing:
        return "failed on more records than allowed, not ranked"
    if not math.isnan(row.rank):
        return f"ranked on the {row.applicable} of these loops that it answers"
    if row.applicable == row.n:
        covered = ""
    else:
        covered = f"applicable to {row.applicable} of these loops, "
    return f"{'with MV, ' * (row.kind == 1)}{covered}not ranked"


def loops_of(rates: Any, share: str) -> Any:
    """Return of how many loops a share is, from the rates along axes."""
    others = rates["n"] - rates["positives"]
    return {"sensitivity": rates["positives"], "false_positives": others}.get(share, rates["n"])
