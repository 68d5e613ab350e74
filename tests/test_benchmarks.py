"""Benchmarks: shares and ratios of a scenario's cost count, and every verb concludes the same."""

import copy
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import perf_shares, verbs_on_records
from tests.simbench.boundary.test_hostile import write

TOLD = {
    "fast": {"minimum_ms": 10.0, "share": {"hammerstein": 0.3, "glue": 0.1, "rest": 0.6}},
    "full": {"minimum_ms": 25.0, "share": {"surrogate": 0.4, "rest": 0.6}},
}


def test_a_slower_machine_is_no_regression():
    slower = copy.deepcopy(TOLD)
    for message in slower.values():
        message["minimum_ms"] *= 7.0
    assert perf_shares.grown(slower, TOLD) == []


@pytest.mark.parametrize(
    ("budget", "name", "share", "words"),
    [
        ("fast", "glue", 0.24, "glue takes 24.0%"),
        ("fast", "newcomer", 0.05, "0.0% when"),
        ("full", "surrogate", 0.84, "84.0%"),
    ],
)
def test_a_share_that_outgrew_the_committed_one_is_told(budget, name, share, words):
    now = copy.deepcopy(TOLD)
    now[budget]["share"][name] = share
    (message,) = perf_shares.grown(now, TOLD)
    assert message.startswith(budget)
    assert words in message


def test_so_is_the_ratio_of_the_budgets():
    now = copy.deepcopy(TOLD)
    now["full"]["minimum_ms"] = 40.0
    assert perf_shares.grown(now, TOLD) == [
        "full costs 4.0 times fast, 2.5 times when last committed"
    ]


def test_time_is_charged_to_whoever_runs_and_adds_up(monkeypatch):
    meter = perf_shares.Meter()
    clock = iter([1.0, 3.0, 4.0, 10.0, 11.0])
    monkeypatch.setattr(meter, "_since", 0.0)
    monkeypatch.setattr(perf_shares, "time", SimpleNamespace(process_time=lambda: next(clock)))
    inner = meter.wrap("inner", lambda: None)
    meter.wrap("outer", inner)()
    meter.charge()
    assert meter.seconds == {"glue": 2.0, "outer": 8.0, "inner": 1.0}


def test_every_verb_s_conclusion_on_labelled_records_is_printed_by_loop_and_by_unit(
    tmp_path, monkeypatch, capsys
):
    (tmp_path / "plant").mkdir()
    for k in range(2):
        write(tmp_path / "plant" / f"r{k}.csv", np.arange(250 + 20 * k))
    labels = tmp_path / "labels.csv"
    labels.write_text("id,loop,label\nr0,A,stiction\nr1,C,no_stiction\n")
    monkeypatch.setattr(
        verbs_on_records, "_VERBS", {"diagnose": verbs_on_records._VERBS["diagnose"]}
    )
    verbs_on_records.main(tmp_path / "plant", labels)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["loop", "label", "records", "diagnose", "detect", "FOLDER"]
    for line in lines[1:3]:
        answers = line.split()[3:]
        assert answers[: len(answers) // 2] == answers[len(answers) // 2 :]
    assert lines[-2].startswith("diagnose, detect FOLDER: Conclusion by loop: stiction in ")
    assert lines[-1].startswith("diagnose, detect FOLDER: Conclusion by unit: stiction in ")
