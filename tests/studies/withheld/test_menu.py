"""The menu of the blind check: every world runs every test, on the same loop, as planned."""

from pathlib import Path

import numpy as np
import pytest

from results.studies.withheld import menu, outcomes
from results.studies.withheld.answering import answer, answers_after
from results.studies.withheld.making import write_item
from results.studies.worlds import load_world
from simbench.detectors.errors import UserError
from simbench.files import folder

WORLDS_RUN = ["own", pytest.param("refinery", marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=WORLDS_RUN)
def shown(request):
    world = load_world(request.param)
    item = world.draw(7, 3, {"kind": "none", "mv": False})
    plans = {id_: menu.plan(id_, item.columns, item.baseline) for id_ in menu.MENU}
    return {id_: (plan, world.test(item.answer, [], 11, plan)) for id_, plan in plans.items()}


def test_every_world_runs_every_test(shown):
    for id_, (plan, columns) in shown.items():
        assert {len(x) for x in columns.values()} == {plan.n}
        assert all(np.isfinite(x).all() for name, x in columns.items() if name != "lab")
        more = {"mode": ("bump", "stairs", "still"), "mv": ("mv",), "lab": ("lab",)}
        assert {x for x in more if x in columns} == {x for x, ids in more.items() if id_ in ids}


def test_in_manual_op_is_what_the_operator_set(shown):
    plan, columns = shown["bump"]
    op, asked = columns["op"][plan.manual], plan.op[plan.manual]
    off = op - np.median(op[asked == 0.0])
    # an archive may hold OP of the scan before
    apart = min(np.abs(off[1:] - asked[1:]).max(), np.abs(off[1:] - asked[:-1]).max())
    assert apart < 0.2
    assert np.ptp(columns["op"][~plan.manual]) > 0.0


def test_set_point_steps_are_as_planned_and_a_faster_log_repeats_op(shown):
    plan, columns = shown["sp_steps"]
    np.testing.assert_allclose(
        columns["sp"] - columns["sp"][0], plan.sp, rtol=0.01, atol=0.02 * np.ptp(plan.sp)
    )
    plan, columns = shown["fast"]
    assert columns["t"][1] == pytest.approx(shown["mv"][1]["t"][1] / plan.faster)
    assert np.mean(np.diff(columns["op"]) == 0.0) > 0.7


def test_lab_samples_are_of_pv_as_it_is(shown):
    plan, columns = shown["lab"]
    off = (columns["lab"] - columns["pv"])[plan.lab]
    assert np.isfinite(columns["lab"]).sum() == plan.lab.size
    assert np.abs(off).max() < 8.0 * (plan.lab_std / 0.5 + 1e-9) + 0.02 * np.ptp(columns["pv"])


def test_a_test_is_written_so_that_it_can_be_read(shown):
    plan, columns = shown["stairs"]
    text = menu.csv_of(columns).splitlines()
    assert text[1].endswith("AUTO")
    assert text[-1].endswith("MAN")
    assert 'id = "stairs"' in menu.settings_toml(plan.settings(2.0))
    assert menu.settings_toml(shown["kc_half"][0].settings(2.0)).endswith(
        "[controller]\nKc_ratio = 0.5\n"
    )


@pytest.fixture
def check(tmp_path, in_this_process):
    world = load_world("own")
    item = world.draw(7, 3, {"kind": "none", "mv": False})
    write_item(item, folder(tmp_path / "records"), "r0001")
    outcomes.write(tmp_path, world.test, {"r0001": item}, 1)
    return tmp_path


def asks(record, baseline, tests=()):
    """Stand in for a diagnosis that asks for a bump, then for stairs, then for no more."""
    wanted = ["bump", "stairs"][len(tests) : len(tests) + 1]
    seen = [t for t in tests if Path(t).read_text(encoding="utf-8")]
    return {
        "effect": "none",
        "seen": len(seen),
        "next_test": {"test": wanted[0]} if wanted else None,
    }


def test_tests_are_opened_in_the_order_they_are_asked_for_and_logged(check):
    answer(check, asks, 1, 2)
    assert (check / outcomes.OPENED_LOG).read_text().splitlines() == [
        "id,order,test",
        "r0001,1,bump",
        "r0001,2,stairs",
    ]
    assert '"seen": 2' in (answers_after(check, 2) / "r0001.json").read_text()
    assert '"seen": 0' in (answers_after(check, 0) / "r0001.json").read_text()
    assert sorted(p.name for p in (check / outcomes.OPENED).glob("*.csv")) == [
        "r0001-bump.csv",
        "r0001-stairs.csv",
    ]


def refuses(record, baseline, tests=()):
    """Stand in for a diagnosis that refuses the test it asked for."""
    if tests:
        raise UserError("no column pv")
    return {"effect": "drift", "next_test": {"test": "bump"}}


def test_where_the_test_is_refused_the_answer_before_it_is_kept(check):
    answer(check, refuses, 1, 1)
    assert '"drift"' in (answers_after(check, 1) / "r0001.json").read_text()


def test_no_more_than_two_are_opened_and_none_where_none_was_made(check, tmp_path):
    with pytest.raises(UserError, match="--tests 3; 0 to 2"):
        answer(check, asks, 1, 3)
    with pytest.raises(UserError, match="holds no tests"):
        outcomes.open_one(tmp_path / "elsewhere", "r0001", "bump", 1)
