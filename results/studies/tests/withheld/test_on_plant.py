"""Tests on the plant: every world runs every test of the product's menu, on the same loop, as
planned.
"""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from results.studies.withheld.answering import TESTS, answer, answers_after
from results.studies.withheld.files import csv_of, settings_toml, write_item
from results.studies.withheld.making import make
from results.studies.withheld.on_plant import planned
from results.studies.worlds import load_world
from simbench.detectors.errors import UserError
from simbench.detectors.records.io import read_record
from simbench.gap.intake.check import check
from simbench.gap.planning.menu import LEAD, Limits, Trial, size_test
from simbench.gap.planning.order import ORDER
from simbench.scenarios.spec import load_loop

WORLDS_RUN = ["own", pytest.param("refinery", marks=pytest.mark.slow)]


@pytest.fixture(scope="module", params=WORLDS_RUN)
def shown(request, tmp_path_factory):
    world = load_world(request.param)
    item = world.draw(7, 3, {"kind": "none", "mv": False})
    record, loop = write_item(item, tmp_path_factory.mktemp("shown"), "record")
    situation = check(read_record(record, automatic=False), load_loop(loop))
    trials = {id_: size_test(id_, situation, {}, 0.0, Limits()) for id_ in ORDER}
    plans = {id_: planned(trial, item.baseline["noise"]["std"]) for id_, trial in trials.items()}
    # a log that no test asks for, and that a user may have
    n = plans["raw"].n // 4 * 4
    alone = np.zeros(n), np.full(n, np.nan)
    log = replace(plans["raw"], id="fast", raw=False)
    plans["fast"] = replace(log, n=n, sp=alone[0], op=alone[1], faster=4)
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
    text = csv_of(columns).splitlines()
    assert text[1].endswith("AUTO")
    assert text[-1].endswith("MAN")
    assert 'id = "stairs"' in settings_toml(plan.settings(2.0))
    assert settings_toml(shown["kc_half"][0].settings(2.0)).endswith(
        "[controller]\nKc_ratio = 0.5\n"
    )


BUMP = Trial(
    "bump", 2.0, 30.0, 1.0, np.append(np.zeros(LEAD), np.repeat([0, 2.0, -2, 0], 30)), True
)
LIKE = {"bump": BUMP, "stairs": replace(BUMP, id="stairs")}


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    place = tmp_path_factory.mktemp("held")
    make(place / "set", place / "set.key", seed=4, n=1)
    Ts = load_loop(place / "set" / "records" / "r0001.toml").sampling.Ts
    return SimpleNamespace(
        set=place / "set",
        key=place / "set.key",
        trials={id_: replace(trial, Ts=Ts) for id_, trial in LIKE.items()},
    )


def test_tests_are_run_in_the_order_they_are_asked_for(held):
    def asks(record, baseline, tests):
        """Stand in for a diagnosis that asks for a bump, then for stairs, then for no more."""
        seen = [Path(t).stem for t in tests if Path(t).with_suffix(".toml").exists()]
        wanted = ["bump", "stairs"][len(tests) : len(tests) + 1]
        return {"effect": "none", "seen": seen}, held.trials[wanted[0]] if wanted else None

    assert answer(held.set, 1, 2, held.key, asks) == 1
    replies = [
        json.loads((answers_after(held.set, i) / "r0001.json").read_text()) for i in range(3)
    ]
    names = ["r0001-bump", "r0001-stairs"]
    assert [reply["seen"] for reply in replies] == [[], names[:1], names]
    assert sorted(p.stem for p in (held.set / TESTS).glob("*.csv")) == names
    assert answer(held.set, 1, 2, held.key, asks) == 0


def test_where_the_test_is_refused_the_answer_before_it_is_kept(held):
    def refuses(record, baseline, tests):
        if tests:
            raise UserError("no column pv")
        return {"effect": "drift"}, held.trials["bump"]

    for place in ("answers", "answers-1"):
        (held.set / place / "r0001.json").unlink(missing_ok=True)
    answer(held.set, 1, 1, held.key, refuses)
    assert '"drift"' in (answers_after(held.set, 1) / "r0001.json").read_text()


def test_no_more_than_two_are_run_and_none_without_the_key(held):
    with pytest.raises(UserError, match="--tests 3; 0 to 2"):
        answer(held.set, 1, 3)
    with pytest.raises(UserError, match="a key is needed"):
        answer(held.set, 1, 1)
