"""The diagnosis procedure: the flow chart is the program, every branch is reached, and each answer
has its reason.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plain_loops import LEVEL

from simbench.detectors.judge import judge
from simbench.detectors.methods.procedure import METHOD
from simbench.detectors.procedure import CONCLUSIONS, FLOW, diagnose
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder, read_labels
from simbench.detectors.report.report import score_units
from simbench.detectors.verdict import VERDICTS

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "real"


def path(diagnosis):
    return [(s.step, s.answer) for s in diagnosis.steps]


def test_flow_chart_is_the_program_and_leads_somewhere_from_everywhere():
    targets = {to for _, answers in FLOW.values() for to in answers.values()}
    assert targets | {"quality"} == set(FLOW) | set(CONCLUSIONS)
    assert all(verdict in VERDICTS and test for verdict, test in CONCLUSIONS.values())
    depth = dict.fromkeys(CONCLUSIONS, 0)
    for _ in FLOW:
        for key, (_, answers) in FLOW.items():
            if all(to in depth for to in answers.values()):
                depth[key] = 1 + max(depth[to] for to in answers.values())
    assert set(FLOW) <= set(depth)


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


def test_negligible_level_needs_no_test_now(loop):
    diagnosis = diagnose(loop(S=0.3, J=0.12, kick=0.21, n=3000))
    assert diagnosis.conclusion in ("slight", "sticky")
    assert ("level", "no") not in path(diagnosis) or "watch" in diagnosis.next_test


def test_oscillation_from_outside_is_none(loop):
    load = 3 * np.sin(2 * np.pi * np.arange(3000) / 60)
    diagnosis = diagnose(loop(S=0.0, J=0.0, load=load, noise=0.1, n=3000))
    assert path(diagnosis)[-1] == ("stiction", "no stiction")
    assert diagnosis.verdict == "no_stiction"
    assert diagnosis.S is None


def test_loop_at_rest_ends_at_the_oscillation(loop):
    diagnosis = diagnose(replace(loop(S=0.0, J=0.0, noise=0.2, n=2000), mv=None, kind="level"))
    assert path(diagnosis)[1:] == [("oscillation", "no"), ("valve", "cannot tell")]
    assert diagnosis.verdict == "no_stiction"
    assert diagnosis.reason.startswith("no sustained oscillation (r = ")


def roaming(S):
    """A slow flow loop whose set point steps make OP turn a few times, but never cycle."""
    op = 50 + np.cumsum(np.repeat([0.02, -0.02, 0.025, -0.02, 0.02, -0.025], 150))
    v, mv = op[0], []
    for u in op:
        v = max(u - S / 2, min(u + S / 2, v))
        mv.append(v)
    pv = 3 * np.array(mv) + 0.1 * np.random.default_rng(0).standard_normal(op.size)
    noise = 0.02 * np.random.default_rng(1).standard_normal(op.size)
    return LoopRecord(
        op + noise - 0.03 * (pv - pv.mean()), pv, 1.0, process="self-regulating", kind="flow"
    )


@pytest.mark.parametrize(("S", "expected"), [(2.4, "stiction"), (0.0, "no_stiction")])
def test_flow_that_rests_shows_the_valve_without_an_oscillation(S, expected):
    record = roaming(S)
    diagnosis = diagnose(record)
    assert ("oscillation", "no") in path(diagnosis)
    assert diagnosis.verdict == expected
    assert diagnose(replace(record, kind="level")).verdict == "no_stiction"
    assert "dead band explains" in diagnosis.reason


def test_dead_record_is_unfit():
    diagnosis = diagnose(LoopRecord(np.full(500, 50.0), np.sin(np.arange(500.0)), 1.0))
    assert path(diagnosis) == [("quality", "no")]
    assert diagnosis.verdict == "no_decision"
    assert np.isnan(diagnosis.score)


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


def test_unknown_units_leave_the_level_open(loop):
    record = replace(loop(n=3000), mv=None, op_span=None)
    diagnosis = diagnose(replace(record, op=record.op * 10))
    assert path(diagnosis)[-1] == ("level", "cannot tell")
    assert diagnosis.S_unit == "OP units"


def test_json_and_text_carry_the_whole_path(loop):
    diagnosis = diagnose(loop(n=3000))
    data = json.loads(json.dumps(diagnosis.as_json(), allow_nan=False))
    assert [s["step"] for s in data["steps"]] == [s.step for s in diagnosis.steps]
    assert {
        "verdict",
        "score",
        "S",
        "J",
        "next_test",
        "reason",
        "steps",
        "verdicts",
        "conclusion",
    } <= set(data)
    text = diagnosis.as_text()
    assert text.count("\n") >= 2 * len(diagnosis.steps)
    assert text.endswith("Verdict of the procedure: stiction.")


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
