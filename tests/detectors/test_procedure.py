"""The diagnosis procedure: each answer on a record that deserves it, real loops among them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plain_loops import LEVEL

from simbench.detectors.judge import judge
from simbench.detectors.methods.procedure import METHOD
from simbench.detectors.procedure import diagnose
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder, read_labels
from simbench.detectors.report.report import score_units

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "real"


def path(diagnosis):
    return [(s.step, s.answer) for s in diagnosis.steps]


@pytest.mark.parametrize(
    "settings", [{"n": 3000, "noise": 0.05}, {**LEVEL, "n": 2000, "noise": 0.05}]
)
def test_sticky_loop_goes_all_the_way(loop, settings):
    diagnosis = diagnose(loop(**settings))
    assert [s for s, _ in path(diagnosis)] == [
        "quality",
        "oscillation",
        "saturation",
        "nonlinearity",
        "stiction",
        "level",
    ]
    # a nonlinearity that is not seen does not end the search
    assert ("nonlinearity", "not seen") in path(diagnosis)
    assert diagnosis.verdict == "stiction"
    assert diagnosis.conclusion == "sticky"
    assert diagnosis.S[0] < 5.0 < diagnosis.S[1] < 10.0
    assert "gain change" in diagnosis.next_test
    assert all(s.question and s.evidence and s.reason for s in diagnosis.steps)


@pytest.mark.parametrize(("n", "unfit"), [(10, True), (99, True), (100, False)])
def test_of_a_record_that_is_too_short_no_step_says_no_stiction(n, unfit):
    op, pv = np.random.default_rng(0).normal(50.0, 2.0, (2, n))
    assert (diagnose(LoopRecord(op, pv, 1.0)).conclusion == "unfit") == unfit


def test_saturated_loop_is_sent_to_its_limits(loop):
    record = loop(n=3000)
    op = np.clip(50 + 30 * np.sin(np.arange(3000) / 10), 40, 100)
    diagnosis = diagnose(
        replace(record, op=op, pv=-np.sin((np.arange(3000) - 5) / 10), op_span=(40, 100))
    )
    assert path(diagnosis)[-1] == ("saturation", "yes")
    assert diagnosis.conclusion == "saturated"


def test_method_gives_the_same_verdict_as_the_procedure(loop):
    record = replace(loop(n=3000, noise=0.05), mv=None)
    verdict, diagnosis = judge(record, ["procedure"])[0], diagnose(record)
    assert (verdict.verdict, verdict.score, verdict.S) == (
        diagnosis.verdict,
        diagnosis.score,
        diagnosis.S,
    )
    strict = judge(record, ["procedure"], thresholds={"procedure": {"odds_high": 15.0}})[0]
    assert strict.verdict == "no_decision"
    assert METHOD.defaults()["odds_low"] < METHOD.defaults()["odds_high"]


@pytest.mark.skipif(not REAL.is_dir(), reason=f"real records are not here ({REAL})")
def test_real_loops_no_false_alarm_and_most_credible_stiction_detected():
    labels = read_labels(REAL / "records.csv")
    each = {name: {"kind": row["kind"], "process": row["process"]} for name, row in labels.items()}
    records, _ = read_folder(REAL, names=labels, each=each)
    verdicts = [(name, judge(record, ["procedure"])[0]) for name, record in records.items()]
    assert all(v.reason for _, v in verdicts)
    credible = {
        name: row for name, row in labels.items() if row["usable"] == "1" and not row["label_doubt"]
    }
    row = score_units(verdicts, credible)[0]
    assert row["positives"] == 5
    assert row["sensitivity"] >= 0.8
    assert score_units(verdicts, labels)[0]["false_positives"] <= 0.07
    dead = [v for name, v in verdicts if "FIC10112" in name]
    assert all(v.verdict == "no_decision" for v in dead)
