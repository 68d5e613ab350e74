"""The gap of a grid: none between two draws of it, and the block of what is known to be missing."""

import json

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.benchmark.measure import describe, draw_loops, grid, tell_apart, with_nuisances
from simbench.gap.benchmark.nuisances import ADDITIONS
from simbench.scenarios.settled import settled_grid


@pytest.fixture(scope="module")
def halves():
    """Loops of `chapter`, and other ones."""
    drawn = draw_loops(settled_grid("chapter"), 120, seed=9)
    return drawn[:60], drawn[60:]


def _records(drawn) -> dict[str, LoopRecord]:
    return {f"{k}": one.record for k, one in enumerate(drawn)}


def test_two_draws_of_a_grid_are_not_told_apart(halves):
    found = grid("chapter", _records(halves[1]), n=60, seed=4, additions=["white noise"])
    assert found.auc.value < 0.65
    assert found.auc.lo < 0.5


def test_a_known_difference_is_found_and_closed(halves):
    name = "quantisation in the archive"
    tried = ["white noise", "load steps", name, "valve lag"]
    changed = with_nuisances(halves[1], [(name, 1.0)], [halves[0][0].record], seed=2)
    found = grid("chapter", _records(changed), n=60, seed=4, additions=tried)
    assert found.auc.lo > 0.8
    assert (found.block, found.effect) == (ADDITIONS[name].block, name)
    assert found.after.auc.value < 0.65
    whole = found.as_json()
    assert json.loads(json.dumps(whole, allow_nan=False)) == whole
    assert name in found.sentence()
    assert name in found.as_text()
    assert len(found.plot().axes[0].get_yticklabels()) == 1 + len(found.together)


@pytest.mark.slow  # that of a grid of records is asked in every run
def test_the_same_answer_for_any_number_of_workers(halves):
    asked = {"n": 12, "additions": ["outliers"]}
    one, other = (grid("smoke", _records(halves[0][:12]), jobs=j, **asked) for j in (1, 2))
    assert one.as_json() == other.as_json()


def test_features_have_no_unit(halves):
    record = halves[0][0].record
    other = LoopRecord(
        0.16 * record.op + 4.0, -30.0 * record.pv, record.Ts, sp=-30.0 * np.asarray(record.sp)
    )
    one, two = describe([record, other])
    # the sign of PV turns what it has in common with OP
    np.testing.assert_allclose(np.abs(one), np.abs(two), atol=1e-6)


def test_no_record_is_judged_by_what_was_learned_of_its_unit():
    rng = np.random.default_rng(0)
    # every unit lies somewhere else, and nothing else tells the two kinds apart
    place = np.repeat(rng.standard_normal(24), 5)[:, None]
    units = np.repeat([f"u{k}" for k in range(24)], 5).tolist()
    area, certain = tell_apart(place[:60], place[60:], units)
    assert area.value < 0.75
    assert 0.0 < certain < 1.0
    apart, _ = tell_apart(place[:60], place[60:] + 9.0, units)
    assert apart.value > 0.99


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("another time constant", 1, 12),
        ("the records' archives", 25, 30),
    ],
)
def test_a_loop_that_a_nuisance_does_not_suit_is_left_out(name, least, most):
    # 18 of these plants are stated in powers of z: for one sampling period, and no time constant
    drawn = draw_loops(settled_grid("recorded"), 30, seed=2)
    lent = [one.record for one in drawn[:5]]
    changed = with_nuisances(drawn, [(name, 1.0)], lent, seed=1)
    assert least <= len(changed) <= most
    assert {one.unit for one in changed} <= {one.unit for one in drawn}


def test_a_nuisance_that_suits_few_loops_is_no_answer():
    drawn = draw_loops(settled_grid("recorded"), 40, seed=2)
    few = ["another time constant"]
    found = grid("recorded", _records(drawn), n=40, seed=3, additions=few)
    assert not found.singles
    assert found.effect == "none"
