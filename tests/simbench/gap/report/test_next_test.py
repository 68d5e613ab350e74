"""What would tell apart what one record leaves open."""

import pytest

from simbench.gap.report.ranked import Ranked, tell_apart
from simbench.loop.effects import block_of


def ranked(*pairs, group=()):
    """Return a ranking of (effect, probability)."""
    lines = [Ranked(e, block_of(e), p, None, None, {}, (e,)) for e, p in pairs]
    return [Ranked(*list(vars(lines[0]).values())[:6], group or lines[0].group), *lines[1:]]


@pytest.mark.parametrize(
    ("ranking", "mv", "said"),
    [
        (ranked(("stiction", 0.97), ("none", 0.03)), False, None),
        (ranked(("none", 0.97), ("stiction", 0.03)), False, None),
        (ranked(("unknown", 0.6), ("stiction", 0.4)), False, None),
        (
            ranked(("stiction", 0.95), group=("deadband", "stiction")),
            False,
            "the valve position (MV) recorded with OP would tell them apart: deadband and stiction",
        ),
        # MV is there already, and tells no more
        (ranked(("stiction", 0.95), group=("deadband", "stiction")), True, None),
        (
            ranked(("drift", 0.5), ("load_drift", 0.4)),
            False,
            "laboratory samples of the process value would tell them apart: drift and load drift",
        ),
        (
            ranked(("none", 0.8), ("stiction", 0.2)),
            False,
            "the valve position (MV) recorded with OP would tell them apart: no effect and"
            " stiction",
        ),
    ],
)
def test_a_measurement_is_named_where_the_record_does_not_decide(ranking, mv, said):
    assert tell_apart(ranking, mv) == said
