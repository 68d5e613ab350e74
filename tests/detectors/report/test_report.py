"""Files in, verdicts out: one record, a folder, labels, plug-ins, and the command line's exit
codes.
"""

import json
import math
from dataclasses import dataclass

import numpy as np
import pytest

from simbench.cli import main
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.detectors.record import LoopRecord
from simbench.detectors.report.report import Report, choose_methods, score_units
from simbench.detectors.report.summary import own_reason, sentence
from simbench.detectors.verdict import Verdict
from simbench.detectors.views import columns
from simbench.verbs import judge_files

KEYS = {"method", "verdict", "score", "indices", "S", "J", "S_unit", "applicable", "reason"}


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


def test_single_file_gives_one_object_per_method_with_the_agreed_keys(folder):
    report = judge_files(
        folder / "sticky.csv", ["horch,he"], kind="flow", process="self-regulating"
    )
    data = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert [d["method"] for d in data] == ["horch", "he"]
    assert all(set(d) == KEYS for d in data)


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


def test_labels_pick_the_records_give_their_kind_and_score(folder):
    report = judge_files(folder, ["he", "hammerstein"], labels=folder / "labels.csv")
    by_method = {row["method"]: row for row in report.scores}
    assert by_method["hammerstein"] == {
        "method": "hammerstein",
        "n": 2,
        "applicable": 2,
        "positives": 1,
        "cost": 0.0,
        "cost_lo": 0.0,
        "cost_hi": pytest.approx(0.6, abs=0.01),
        "accuracy": 1.0,
        "sensitivity": 1.0,
        "false_positives": 0.0,
        "no_decision": 0.0,
        "auc": 1.0,
    }
    assert all("unknown" not in v.reason for _, v in report.verdicts)
    assert "positives" in report.as_text()


def test_command_line_knows_what_it_is_told(folder):
    report = judge_files(folder / "sticky.csv", ["he"], process="integrating")
    assert "PV is" in report.verdicts[0][1].reason


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


def test_units_are_ranked_by_cost_next_to_what_always_no_and_always_yes_cost():
    answers = {
        "m": ("stiction", "no_decision"),
        "n": ("no_stiction", "no_stiction"),
        "o": ("stiction", "no_stiction"),
    }
    verdicts = [
        (f"r{k}", Verdict(m, word, 0.0, reason="-"))
        for m, words in answers.items()
        for k, word in enumerate(words)
    ]
    labels = {
        "r0": {"label": "stiction", "unit_group": "A"},
        "r1": {"label": "tuning", "unit_group": "B"},
    }
    rows = score_units(verdicts, labels)
    assert [(row["method"], row["cost"]) for row in rows] == [("o", 0.0), ("m", 0.25), ("n", 0.5)]
    assert (
        "of 2 units always no costs 0.50, always yes 0.50"
        in Report(verdicts, scores=rows).as_text()
    )


def test_a_loop_that_does_not_oscillate_counts_in_the_area_below_every_score():
    scores = {"a": -math.inf, "b": 0.3, "c": -math.inf, "d": -math.inf, "e": 0.1, "f": math.nan}
    verdicts = [
        (name, Verdict("m", "no_stiction", score, reason="-")) for name, score in scores.items()
    ]
    labels = {
        name: {"label": "stiction" if name in "ab" else "tuning", "unit_group": name}
        for name in scores
    }
    # a against c, d, e: 1/2, 1/2, 0; b against them: 1, 1, 1; f has no score at all
    assert score_units(verdicts, labels)[0]["auc"] == pytest.approx(4 / 6)


def test_labels_without_a_folder_are_refused(folder):
    with pytest.raises(ParameterError, match="labels score a folder"):
        judge_files(folder / "sticky.csv", ["he"], labels=folder / "labels.csv")


PLUGIN = '''"""Judge nothing."""
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict
METHOD = Method(title="coin", source="nobody")
def detect(prepared):
    return Verdict("coin", "no_decision", reason="heads or tails")
'''


def test_plugin_file_is_judged_next_to_the_others(folder, tmp_path):
    (tmp_path / "coin_of_mine.py").write_text(PLUGIN)
    report = judge_files(folder / "sticky.csv", ["he"], plugins=[tmp_path / "coin_of_mine.py"])
    assert [v.method for _, v in report.verdicts] == ["he", "coin_of_mine"]


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


def test_level_is_a_number_or_an_interval_in_the_text():
    shown = (
        Report([(None, Verdict("m", "stiction", S=1.5, J=(0.0, 1.0), reason="so"))])
        .as_text()
        .splitlines()
    )
    assert shown[1].split() == [
        "method",
        "verdict",
        "score",
        "S",
        "(%",
        "of",
        "travel)",
        "J",
        "applicable",
    ]
    assert shown[2].split() == ["m", "stiction", "1.5", "0", "to", "1", "yes"]


def test_cells_stand_in_equal_columns():
    assert columns([("a", "b"), ("long", "c")]) == ["a     b", "long  c"]


def test_what_the_methods_say_together_counts_each():
    verdicts = [Verdict("he", "stiction", reason="r"), Verdict("horch", "no_decision", reason="r")]
    assert sentence(verdicts) == "1 of 2 methods reports stiction, 0 no stiction, 1 no decision"


def test_what_is_noted_of_the_whole_record_is_not_repeated():
    verdict = Verdict("he", "stiction", reason="OP is triangular; OP taken as 0..100 %")
    assert own_reason(verdict, ["OP taken as 0..100 %"]) == "OP is triangular"


@dataclass
class Concluded:
    """A conclusion of which the ranking shows verdict and probability."""

    probability: float

    def as_lines(self):
        return ["so", "Reason: so.", "Next: nothing."]

    def as_json(self):
        return {"verdict": "stiction", "probability": self.probability, "cause": "stiction"}


def test_a_large_folder_fits_a_screen_and_says_how_many_loops_it_leaves_out():
    names = [f"loop{k}" for k in range(40)]
    record = LoopRecord(np.sin(np.arange(50.0)), np.cos(np.arange(50.0)), 1.0)
    report = Report(
        [(name, Verdict("m", "stiction", reason="so")) for name in names],
        records=dict.fromkeys(names, record),
        conclusions={name: Concluded(k / 40) for k, name in enumerate(names)},
    )
    lines = report.as_text().splitlines()
    assert len(lines) <= 30
    assert "and 20 more loops: --csv FILE" in lines
    assert lines[1].startswith("loop39 ")  # the most probable first
