"""What speaks for something unknown in one record or several: facts and tests."""

from types import SimpleNamespace

import pytest

from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.left_over import Left

FAILED = Left(0.8, "disturbance", "innovations remember")
PASSED = Left(0.1, "process", "OP tells nothing")


def situation(*, law="", frozen=False, trusted=True, proven=None):
    return SimpleNamespace(
        unexplained_law=law,
        frozen=frozen,
        trusted=trusted,
        proven=proven or {},
        record=SimpleNamespace(mv=None),
        samples=SimpleNamespace(held=42),
    )


def assessed(here, tests=(PASSED,), valve=False, others=()):
    return Assessment(
        here,
        None,
        {},
        {},
        [],
        None,
        tests=tests,
        mv_unexplained=valve,
        other_records=others,
    )


def test_a_test_fails_that_makes_something_unknown_more_probable_than_not():
    assert assessed(situation(), (PASSED, FAILED)).unexplained == {
        "disturbance": "innovations remember"
    }
    assert assessed(situation()).unexplained == {}
    assert assessed(situation()).worst_test == (0.1, "process")
    assert assessed(situation(), ()).worst_test == (0.0, "none")


@pytest.mark.parametrize(
    ("here", "valve", "block"),
    [
        (situation(law="OP stands still"), False, "controller"),
        (situation(frozen=True), False, "sensor"),
        (situation(frozen=True, proven={"frozen_sensor": {}}), False, None),
        (situation(), True, "valve"),
        (situation(frozen=True, trusted=False), False, None),
    ],
)
def test_what_needs_no_statistics_outranks_a_failed_test(here, valve, block):
    found = assessed(here, (FAILED,), valve)
    assert set(found.unexplained) == {"disturbance", *([block] if block else [])}
    worst = (pytest.approx(0.99), block) if block else (0.8, "disturbance")
    assert found.worst_test == worst


def test_what_another_record_of_the_loop_shows_counts_as_much_as_what_this_one_does():
    other = assessed(situation(), (FAILED,))
    both = assessed(situation(law="OP stands still"), others=(other,))
    assert list(both.unexplained) == ["controller", "disturbance"]
    assert both.unexplained["controller"] == "OP stands still"
    assert assessed(situation(), others=(other,)).worst_test == (0.8, "disturbance")
