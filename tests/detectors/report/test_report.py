"""Files in, verdicts out: a folder, its labels and units, and what a command prints."""

import json
import math

import numpy as np
import pytest

from simbench.cli import main
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.detectors.report.report import choose_methods, score_units
from simbench.detectors.report.summary import own_reason, sentence
from simbench.detectors.verdict import Verdict
from simbench.verbs import judge_files


def save(record, file):
    rows = np.column_stack([record.t, record.op, record.pv])
    np.savetxt(file, rows, delimiter=",", header="t_s,op,pv", comments="", fmt="%.10g")
    return file


@pytest.fixture
def folder(loop, tmp_path):
    save(loop(n=2000, noise=0.05), tmp_path / "sticky.csv")
    load = 3 * np.sin(2 * np.pi * np.arange(2000) / 60)
    save(loop(S=0.0, J=0.0, load=load, noise=0.1, n=2000), tmp_path / "healthy.csv")
    (tmp_path / "notes.txt").write_text("a,b\n1,2\n")
    head = "id,label,type,dynamics,unit_group\n"
    body = "sticky,stiction,flow,self_regulating,A\nhealthy,no_stiction,flow,self_regulating,B\n"
    (tmp_path / "labels.csv").write_text(head + body)
    return tmp_path


def test_folder_adds_the_record_and_names_what_it_left_out(folder):
    report = judge_files(folder, ["he"])
    answers = report.as_json()
    assert [d["record"] for d in answers if d["method"]] == ["healthy", "sticky"]
    refused = {d["record"]: d["reason"] for d in answers if d["method"] is None}
    assert refused == report.refused
    assert set(refused) == {"labels", "notes"}
    assert all(d["event"] is None for d in answers)
    assert report.loops().conclusion.tolist()[-2:] == ["no record"] * 2
    assert report.scores == []


def test_sets_of_methods():
    everything, fast = choose_methods(["all"]), choose_methods(["fast"])
    assert everything == choose_methods(["full"])
    slow = {"arx_stiction", "horch_isaksson", "stenman", "surrogate"}
    assert set(everything) - set(fast) == slow
    with pytest.raises(UnknownName, match="did you mean 'horch'"):
        choose_methods(["horhc"])


def test_a_unit_that_a_method_is_not_made_for_is_not_undecided(folder):
    horch = judge_files(
        folder, ["horch"], labels=folder / "labels.csv", process="integrating"
    ).scores[0]
    assert (horch["n"], horch["applicable"], horch["positives"]) == (2, 0, 0)
    assert math.isnan(horch["no_decision"])


def test_units_count_once_and_undecided_records_do_not_vote():
    def one(verdict, score):
        return Verdict("m", verdict, score, reason="-")

    verdicts = [
        ("a1", one("stiction", 2.0)),
        ("a2", one("no_decision", 0.0)),
        ("a3", one("no_decision", 0.0)),
        ("b1", one("no_stiction", -1.0)),
        ("b2", one("stiction", 1.0)),
        ("c", one("no_decision", 0.5)),
        ("d", one("stiction", 9.0)),
    ]
    truth = {
        "a": ("stiction", "A"),
        "b": ("tuning", "B"),
        "c": ("no_stiction", "C"),
        "d": ("unknown", "D"),
    }
    labels = {
        name: dict(zip(("label", "unit_group"), truth[name[0]], strict=True))
        for name, _ in verdicts
    }
    row = score_units(verdicts, labels)[0]
    assert (row["n"], row["positives"], row["sensitivity"], row["false_positives"]) == (3, 1, 1, 0)
    assert row["no_decision"] == pytest.approx(1 / 3)
    assert row["accuracy"] == pytest.approx(2 / 3)
    assert row["auc"] == pytest.approx(0.25)
    # A found, B as often yes as no and so not called sticky, C undecided
    assert row["cost"] == pytest.approx(0.5 / 3)
    assert 0.0 <= row["cost_lo"] < row["cost"] < row["cost_hi"] < 1.0


def test_labels_without_a_folder_are_refused(folder):
    with pytest.raises(ParameterError, match="labels score a folder"):
        judge_files(folder / "sticky.csv", ["he"], labels=folder / "labels.csv")


def test_command_prints_json_and_nothing_else(folder, capsys):
    assert (
        main(
            [
                "detect",
                str(folder),
                "--method",
                "he",
                "--labels",
                str(folder / "labels.csv"),
                "--json",
            ]
        )
        == 0
    )
    out, err = capsys.readouterr()
    assert len(json.loads(out)) == 2
    assert "score by unit" in err


def test_command_prints_lines_for_people(folder, capsys):
    assert (
        main(
            [
                "detect",
                str(folder / "sticky.csv"),
                "--method",
                "hammerstein",
                "--process",
                "self-regulating",
            ]
        )
        == 0
    )
    out = capsys.readouterr().out
    assert out.splitlines()[1] == "Methods: hammerstein reports stiction."
    assert "S (% of travel)" in out


def test_what_the_methods_say_together_counts_each():
    verdicts = [Verdict("he", "stiction", reason="r"), Verdict("horch", "no_decision", reason="r")]
    assert sentence(verdicts) == "1 of 2 methods reports stiction, 0 no stiction, 1 no decision"


def test_what_is_noted_of_the_whole_record_is_not_repeated():
    verdict = Verdict("he", "stiction", reason="OP is triangular; OP taken as 0..100 %")
    assert own_reason(verdict, ["OP taken as 0..100 %"]) == "OP is triangular"
