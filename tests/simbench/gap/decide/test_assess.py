"""Just inside and just outside: what the best model may leave behind, and what counts beyond."""

from types import SimpleNamespace

import pytest
from left_out import left_out

from simbench.gap.decide.assess import RESIDUAL_LIMITS, Assessment

BLOCKS = {
    "memory": (15.0, "disturbance"),
    "input": (10.0, "process"),
    "shifts": (10.0, "sensor"),
}
QUIET = dict.fromkeys(BLOCKS, 0.0)


def situation(*, law="", frozen=False, trusted=True, facts=None):
    return SimpleNamespace(
        unexplained_law=law,
        frozen=frozen,
        trusted=trusted,
        facts=facts or {},
        record=SimpleNamespace(mv=None),
        samples=SimpleNamespace(held=42),
    )


def assessed(here, tests=QUIET, valve=False, others=()):
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


def blocks(*args, **kwargs):
    return set(assessed(*args, **kwargs).unexplained)


@pytest.mark.parametrize("name", list(BLOCKS))
@pytest.mark.parametrize("share", [-5.0, 0.95, 1.05])
def test_a_residual_test_fails_in_its_block_beyond_its_limit(name, share):
    assert set(RESIDUAL_LIMITS) == set(BLOCKS)
    limit, block = BLOCKS[name]
    here = assessed(situation(), QUIET | {name: share * limit})
    assert set(here.unexplained) == ({block} if share > 1.0 else set())
    ratios = [r for r, _, message in here.failures if name.removesuffix(" nats") in message]
    assert max(ratios) == pytest.approx(max(share, 0.0))


@pytest.mark.parametrize(
    ("here", "valve", "block"),
    [
        (situation(law="OP stands still"), False, "controller"),
        (situation(frozen=True), False, "sensor"),
        (situation(), True, "valve"),
        (situation(facts={"compression": "PV rings"}), False, "sensor"),
        (situation(facts={"quantisation": "PV stands on a lattice"}), False, None),
        (situation(frozen=True, trusted=False), False, None),
    ],
)
def test_what_needs_no_statistics_outranks_a_failed_test(here, valve, block):
    with left_out("compression"):
        outranks(here, valve, block)


def outranks(here, valve, block):
    assert blocks(here, valve=valve) == ({block} if block else set())
    # memory at five times its limit
    tests = QUIET | {"memory": 75.0} if here.trusted else QUIET
    worst = assessed(here, tests, valve).worst_test
    if block:
        assert worst == (pytest.approx(10.0), block)
    elif here.trusted:
        assert worst == (pytest.approx(5.0), "disturbance")


def test_what_another_record_of_the_loop_shows_counts_as_much_as_what_this_one_does():
    other = assessed(situation(), QUIET | {"memory": 75.0, "input": 11.0})
    both = assessed(situation(law="OP stands still"), others=(other,))
    assert list(both.unexplained) == ["controller", "disturbance", "process"]
    assert both.unexplained["controller"] == "OP stands still"
    assert assessed(situation(), others=(other,)).worst_test == (pytest.approx(5.0), "disturbance")
