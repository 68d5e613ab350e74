"""Claims are held against what was measured, loop by loop."""

from types import SimpleNamespace

import numpy as np
import pytest

from results.studies import trust_claims as claims
from results.studies import trust_learn as learn
from results.studies.trust_learn import LEARNING, TESTING, fit, kept, loops


def row(sticky, probability, verdict, visible, S, healthy, found, said="cannot tell"):
    power = [{"S": s, "J": s, "found": f} for s, f in ((1.0, 0.0), (4.0, 1.0))]
    return {
        "sticky": sticky, "probability": probability, "said": said, "S": S, "J": S, "healthy": {"he": healthy},
        "methods": [{"method": "he", "verdict": verdict, "false_alarms": 0.1, "power": power}],
        "best": {"method": "he", "says": verdict}, "with_friction": None if found is None else {"he": found}, "fitted": found,
        "smallest_visible": None if visible is None else {"S": visible, "J": visible},
    }  # fmt: skip


ROWS = [
    row(True, 0.9, "stiction", 2.0, 4.5, 0.2, 1.0, "stiction"),
    row(True, 0.4, "no_stiction", 2.0, 0.5, 0.0, 0.1, "no stiction"),
    row(False, 0.1, "no_stiction", None, 0.0, 0.0, None),
]


def test_the_cell_nearest_to_the_truth_is_what_was_claimed():
    lines = claims._claims(ROWS)
    name, alarms, measured, _, power, found, off = lines[2].split()
    assert (name, alarms, measured) == ("he", "0.10", "0.07")
    assert (power, found) == ("0.50", "0.55")
    assert float(off) == pytest.approx(0.05)
    assert lines[-2].endswith("1 of 1 methods; power: 1 of 1")


def test_false_alarms_are_held_against_loops_that_are_sound_themselves():
    sticky, sound = row(True, 0.9, "stiction", 2.0, 4.5, 0.4, 1.0), row(False, 0.1, "no_stiction", None, 0.0, 0.1, None)
    lines = claims._claims([sticky, sound])
    assert "mean over the loops: 0 of 1 methods" in lines[-2]
    assert lines[-1] == "the same over the 1 loops whose own valve is sound: 1 of 1 methods"


def test_only_small_friction_is_said_to_be_invisible():
    lines = claims._visible(ROWS)
    assert "buried: below the smallest that detectors show 1 of 1" in lines[2]
    assert "cannot be seen 1 of 1" in lines[2]
    assert "plainly visible: below the smallest that detectors show 0 of 1" in lines[3]


def test_sticky_and_healthy_loops_weigh_the_same_in_the_calibration():
    p, sticky = np.array([0.9, 0.9, 0.9, 0.1]), np.array([True, True, True, False])
    weight = np.where(sticky, 0.5 / 3, 0.5)
    assert claims._error(p, sticky, weight) == pytest.approx(0.1)


def test_a_probability_is_held_against_the_share_that_sticks():
    rows = [
        {"sticky": i % 2 == 0, "gain": 40.0 if i % 2 == 0 else -40.0, "said": {"procedure": ["no_stiction", None]}}
        for i in range(8)
    ]
    lines = claims._probability(rows)
    assert lines[0] == "probability of stiction, 8 loops, 4 sticky: claimed, share sticky, loops"
    assert [line.split()[1:] for line in lines[1:3]] == [["0.00", "4"], ["1.00", "4"]]
    assert "trust 1.00, procedure 0.50" in lines[4]
    assert "4 of 4 (0.51 to 1.00) of the sticky, 0 of 4 (0.00 to 0.49) of the healthy" in lines[5]


def test_who_is_right_is_counted_on_the_same_loops():
    lines = claims.who_is_right([*ROWS, row(True, 0.8, "no_stiction", None, 1.0, 0.0, 0.5) | {"best": None}])
    assert lines[1] == "right on 3 loops: best detector in hindsight (he) 0.67"
    assert lines[3].startswith("probability above one half 0.67 (0 won, 0 lost")


def test_an_abstention_is_not_right():
    assert not claims._right("no_decision", True)
    assert not claims._right("no_decision", False)


def test_loops_learned_on_are_never_tested_on():
    learned = {s.tags["cell"] for s in loops(6, LEARNING)}
    tested = {s.tags["cell"] for s in loops(6, TESTING)}
    assert learned
    assert not learned & tested


def test_where_loops_outnumber_groups_the_other_loops_of_the_groups_follow_once(monkeypatch):
    monkeypatch.setattr(learn, "load_grid", lambda name: SimpleNamespace(group_count=9, group=lambda i: i))
    monkeypatch.setattr(learn, "resolve", lambda i: [(i, "sticky"), (i, "healthy")])
    few, more, most = (list(loops(count, TESTING)) for count in (3, 6, 100))
    assert few == more[:3] == most[:3]
    assert more == most[:6]
    assert sorted(most) == sorted((i, kind) for i in (1, 3, 5, 7) for kind in ("sticky", "healthy"))
    assert sorted(i for i, _ in most[:4]) == [1, 3, 5, 7]


def test_a_calibration_learned_on_telling_evidence_believes_it():
    def loop(i, sticky, gain, verdict):
        return {"sticky": sticky, "gain": gain, "valve": f"kind {i % 6}", "said": {"procedure": [verdict, None]}}

    rows = [loop(i, i % 2 == 0, 20.0 * (-1) ** i, "stiction" if i % 2 == 0 else "no_stiction") for i in range(60)]
    rows += [loop(i, i % 4 > 1, 0.0, "no_decision") for i in range(24)]
    found = fit(rows)
    assert found.probability(20.0, True) > 0.8
    assert found.probability(-20.0, False) < 0.2
    assert 0.3 < found.probability(0.0, False) < 0.7
    assert found.loops == 84
    assert found.log_loss < 0.5


def test_what_was_found_is_not_looked_for_again(tmp_path):
    seen = []
    for _ in range(2):
        rows = kept(tmp_path, 2, LEARNING, lambda s: seen.append(s.id) or {"sticky": True})
    assert len(seen) == len(rows) == len(list(tmp_path.iterdir()))
