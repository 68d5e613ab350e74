"""trust(): the conclusion of every verb, and methods counted on loops that copy the record."""

import json
from dataclasses import replace
from importlib import import_module

import numpy as np
import pandas as pd
import pytest
from recorded import STICKY as STUCK
from recorded import no_loop_near, resting

from simbench.cli import main
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.files import write_record
from simbench.gap.diagnosis import conclude
from simbench.trust.trust import trust

MODULE = import_module("simbench.trust.trust")  # its name is that of a function, too

FEW = {"methods": ["he,horch,hammerstein"], "repeats": 1}


@pytest.fixture(scope="module")
def sticky():
    return resting(1, **STUCK)


@pytest.fixture(scope="module")
def trusted(sticky):
    return trust(sticky, **FEW)


def test_plain_stiction_is_called_so(trusted, sticky):
    assert trusted.conclusion.verdict == STICTION
    assert trusted.probability == conclude(sticky).probability > 0.8


def test_workers_change_no_answer(sticky, trusted):
    assert trust(sticky, **FEW, jobs=2).as_json() == trusted.as_json()


def test_methods_stand_by_what_they_cost_on_loops_like_this_one(trusted):
    costs = [m.cost for m in trusted.methods]
    assert costs == sorted(costs)
    assert trusted.best is trusted.methods[0]
    assert trusted.loops >= 12
    table = trusted.scores.table.query("truth == 'cycled' and process == 'all'")
    table = table[table["population"] == "all"].set_index("method")
    for m in trusted.methods:
        row = table.loc[m.verdict.method]
        assert (m.cost, m.accuracy) == (row["cost"], row["accuracy"])


def test_a_test_for_any_nonlinearity_is_not_the_best_method(sticky):
    answer = trust(sticky, methods=["bicoherence,ellipse"], repeats=1)
    assert [m.verdict.method for m in answer.methods] == ["ellipse", "bicoherence"]
    assert answer.methods[1].cost is None
    assert answer.best.verdict.method == "ellipse"


def test_the_smallest_size_is_the_one_from_which_all_are_found():
    said = {1.0: [1, 1, 1, 1, 0], 2.0: [1, 0, 0, 1, 1], 4.0: [1, 1, 1, 1, 0], 8.0: [1] * 5}
    rows = [
        {"method": "m", "S": S, "sticky": True, "verdict": STICTION if x else NO_DECISION}
        for S, answers in said.items()
        for x in answers
    ]
    rows.append({"method": "m", "S": 0.0, "sticky": False, "verdict": NO_DECISION})
    rows += [{**row, "method": "none", "verdict": NO_DECISION} for row in rows]
    assert MODULE._smallest(pd.DataFrame(rows)) == {"m": 4.0, "none": None}


def test_a_wild_sample_changes_no_verb_s_conclusion(sticky, trusted, tmp_path, capsys):
    pv = np.array(sticky.pv)
    pv[pv.size // 2] = 1e9
    wild = replace(sticky, pv=pv)
    note = "outliers: 1 sample of PV contradicts its neighbours on both sides and counts as missing"
    again = trust(wild, **FEW)
    assert again.conclusion.verdict == conclude(wild).verdict == trusted.conclusion.verdict
    assert again.probability == conclude(wild).probability
    assert note in again.conclusion.notes
    file = tmp_path / "wild.csv"
    write_record(wild, file)
    for words in (("diagnose",), ("gap", "diagnose", "--identify")):
        assert main([*words, str(file)]) == 0
        shown = " ".join("".join(capsys.readouterr()).split())
        assert note in shown
        assert "1e+09" not in shown
        assert f"(probability of stiction {again.probability:.2f})" in shown


def test_a_record_without_a_near_loop_is_judged_and_ranks_no_method(sticky, monkeypatch):
    monkeypatch.setattr(MODULE, "loop_of", no_loop_near)
    trusted = trust(sticky, **FEW)
    assert trusted.conclusion.verdict == STICTION
    assert trusted.best is None
    assert trusted.loops == 0
    assert "unknown: no loop is near the record" in trusted.as_text()
    assert {m.verdict.method for m in trusted.methods} == {"he", "horch", "hammerstein"}


def test_a_dead_record_is_no_error_and_no_verdict():
    n = 600
    dead = LoopRecord(np.full(n, 50.0), np.full(n, 20.0), 1.0)
    trusted = trust(dead, **FEW)
    assert trusted.conclusion.verdict == NO_DECISION
    assert trusted.best is None
    assert json.loads(json.dumps(trusted.as_json(), allow_nan=False)) == trusted.as_json()


def test_methods_that_need_mv_are_counted_where_the_record_has_it(sticky):
    seen = replace(sticky, mv=np.array(sticky.op))
    for record, counted in ((sticky.without_mv(), False), (seen, True)):
        trusted = trust(record, methods=["yamashita,he"], repeats=1)
        costs = {m.verdict.method: m.cost for m in trusted.methods}
        assert costs["he"] is not None
        assert (costs["yamashita"] is not None) is counted


def test_at_least_one_draw_is_needed(sticky):
    with pytest.raises(ParameterError, match="repeats = 0"):
        trust(sticky, repeats=0)


def test_the_verb_answers_on_a_file(tmp_path, capsys, sticky):
    file = tmp_path / "rec.csv"
    write_record(sticky, file)
    assert main(["trust", str(file), "--method", "he", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["best"] == "he"
    assert answer["conclusion"]["verdict"] == STICTION
    assert main(["trust", str(file), "--method", "he"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "simulations of loops like this one he is right in" in shown
    assert main(["detect", str(file), "--method", "he", "--power"]) == 0
    assert "simulations of loops like this one he is right in" in " ".join(
        capsys.readouterr().out.split()
    )
