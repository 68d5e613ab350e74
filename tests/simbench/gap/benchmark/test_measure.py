"""The gap of a grid: none between two draws of it, and the block of what is known to be missing."""

import inspect
import json
from pathlib import Path

import numpy as np
import pytest

from simbench.bench.execute.compute_piece import record_hash
from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.benchmark import nuisances
from simbench.gap.benchmark.draw import draw_loops, with_nuisances
from simbench.gap.benchmark.measure import grid
from simbench.gap.benchmark.nuisances import ADDITIONS
from simbench.gap.benchmark.page import write_page
from simbench.loop.effects import EFFECTS
from simbench.scenarios.errors import SpecError
from simbench.scenarios.settled import settled_grid


@pytest.fixture(scope="module")
def halves():
    """Loops of `chapter`, and other ones."""
    drawn = draw_loops(settled_grid("chapter"), 120, seed=9)
    return drawn[:60], drawn[60:]


def _records(drawn) -> dict[str, LoopRecord]:
    return {f"{k}": one.record for k, one in enumerate(drawn)}


def test_two_draws_of_a_grid_are_not_told_apart(halves, monkeypatch):
    monkeypatch.setattr("simbench.gap.benchmark.measure._every", lambda: [("white noise", 1.0)])
    found = grid("chapter", _records(halves[1]), n=60, seed=4, methods=())
    assert found.auc.value < 0.65
    assert found.auc.lo < 0.5


@pytest.mark.parametrize("name", ["quantisation in the archive", "derivative action"])
def test_a_known_difference_is_found_and_closed(halves, monkeypatch, name):
    tried = [("white noise", 1.0), ("load steps", 1.0), (name, 1.0), ("valve lag", 1.0)]
    monkeypatch.setattr("simbench.gap.benchmark.measure._every", lambda: tried)
    changed = with_nuisances(halves[1], [(name, 1.0)], [halves[0][0].record], seed=2)
    found = grid("chapter", _records(changed), n=60, seed=4, methods=["horch"])
    assert found.auc.lo > 0.9
    assert (found.block, found.effect) == (ADDITIONS[name].block, name)
    assert found.after.auc.value < 0.65
    whole = found.as_json()
    assert json.loads(json.dumps(whole, allow_nan=False)) == whole
    assert 0.0 <= whole["before"]["accuracy"]["horch"] <= 1.0
    assert name in found.sentence()
    assert name in found.as_text()


def test_the_same_answer_for_any_number_of_workers(halves, monkeypatch, tmp_path):
    monkeypatch.setattr("simbench.gap.benchmark.measure._every", lambda: [("outliers", 1.0)])
    asked = {"n": 20, "methods": ["horch"]}
    one, other = (grid("smoke", _records(halves[0][:20]), jobs=j, **asked) for j in (1, 2))
    assert one.as_json() == other.as_json()
    write_page(one, tmp_path / "gap.html")
    assert "Does the grid look like these loops?" in (tmp_path / "gap.html").read_text()


def test_what_cannot_be_compared_is_said(halves):
    with pytest.raises(UserError, match="3 records; at least 10"):
        grid("smoke", _records(halves[0][:3]))
    with pytest.raises(UserError, match="n = 2 loops"):
        grid("smoke", _records(halves[0][:12]), n=2)
    with pytest.raises(UserError, match=r"addition 'outlires'.*'outliers'"):
        grid("smoke", _records(halves[0][:12]), additions=["outlires"])
    with pytest.raises(SpecError, match="unknown grid"):
        grid("smok", _records(halves[0][:12]))


@pytest.mark.parametrize("name", ADDITIONS)
def test_every_nuisance_changes_a_record(halves, name):
    lent = halves[1][0].record
    sp = np.asarray(lent.sp) + (np.arange(lent.n) > lent.n // 3)
    lent = LoopRecord(np.round(lent.op, 1), np.round(lent.pv, 2), lent.Ts, sp=sp)
    changed = with_nuisances(halves[0][:16], [(name, 1.0)], [lent], seed=1)
    assert len(changed) >= 4
    known = {record_hash(one.record) for one in halves[0][:16]}
    assert sum(record_hash(one.record) in known for one in changed) < len(changed) / 2


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("the records' samples per period", 1, 12),
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
    few = ["the records' samples per period", "another time constant"]
    found = grid("recorded", _records(drawn), n=40, seed=3, methods=(), additions=few)
    assert not found.singles
    assert found.effect == "none"


def test_every_effect_but_friction_and_tuning_is_tried():
    tried = inspect.getsource(nuisances) + Path(nuisances.__file__).with_suffix(".toml").read_text()
    left = [e for e in EFFECTS if f'"{e}"' not in tried]
    # friction is what is asked about, and labels would change with it
    assert left == ["stiction", "deadband"]
