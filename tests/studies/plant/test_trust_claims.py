"""Claims are held against what was measured, loop by loop."""

import pytest

from results.studies.plant import trust_claims as claims
from results.studies.plant.trust_claims import TESTING, kept


def row(sticky, probability, verdict, visible, S, healthy, share, answer="cannot tell"):
    power = [{"S": s, "J": s, "found": f} for s, f in ((1.0, 0.0), (4.0, 1.0))]
    return {
        "sticky": sticky,
        "probability": probability,
        "said": answer,
        "S": S,
        "J": S,
        "healthy": {"he": healthy},
        "methods": [{"method": "he", "verdict": verdict, "false_alarms": 0.1, "power": power}],
        "best": {"method": "he", "says": verdict},
        "with_friction": None if share is None else {"he": share},
        "fitted": share,
        "smallest_visible": None if visible is None else {"S": visible, "J": visible},
    }


ROWS = [
    row(True, 0.9, "stiction", 2.0, 4.5, 0.2, 1.0, "stiction"),
    row(True, 0.4, "no_stiction", 2.0, 0.5, 0.0, 0.1, "no_stiction"),
    row(False, 0.1, "no_stiction", None, 0.0, 0.0, None),
]


def test_the_cell_nearest_to_the_truth_is_what_was_claimed():
    lines = claims._claims(ROWS)
    name, alarms, measured, _, power, share, off = lines[2].split()
    assert (name, alarms, measured) == ("he", "0.10", "0.07")
    assert (power, share) == ("0.50", "0.55")
    assert float(off) == pytest.approx(0.05)
    assert lines[-2].endswith("1 of 1 methods; power: 1 of 1")


def test_only_small_friction_is_called_invisible():
    lines = claims._visible(ROWS)
    assert "buried: below the smallest that detectors show 1 of 1" in lines[2]
    assert "says that it cannot be seen 1 of 1" in lines[2]
    assert "plainly visible: below the smallest that detectors show 0 of 1" in lines[3]


def test_who_is_right_is_counted_on_the_same_loops():
    lines = claims.who_is_right(
        [*ROWS, row(True, 0.8, "no_stiction", None, 1.0, 0.0, 0.5) | {"best": None}]
    )
    assert lines[1] == "right on 3 loops: best detector in hindsight (he) 0.67"
    assert lines[3].startswith("probability above one half 0.67 (0 won, 0 lost")


def test_answered_loops_are_not_asked_again(tmp_path):
    seen = []
    for _ in range(2):
        rows = kept(tmp_path, 2, TESTING, lambda s: seen.append(s.id) or {"sticky": True})
    assert len(seen) == len(rows) == len(list(tmp_path.iterdir()))
