"""What happens to every record before a method sees it."""

from dataclasses import replace

import numpy as np
import pytest
from plain_loops import DELAYED

from simbench.detectors.judge import judge
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord

T = np.arange(2000.0)
SINE = {"op": np.sin(T / 8), "pv": -np.sin(T / 8), "Ts": 1.0}
NOISE = dict(
    zip(("op", "pv"), np.random.default_rng(0).standard_normal((2, 2000)), strict=True)
) | {"Ts": 1.0}


def test_without_a_sustained_oscillation_the_answer_is_no_stiction_with_its_regularity():
    verdict = judge(LoopRecord(**NOISE), ["he"])[0]
    assert verdict.verdict == "no_stiction"
    assert verdict.reason.startswith("no sustained oscillation (r = ")
    assert verdict.score == -np.inf
    assert verdict.as_json()["score"] is None
    assert verdict.indices["regularity"] == pytest.approx(
        Prepared(LoopRecord(**NOISE)).oscillation.regularity
    )


def test_raw_judges_without_the_front_end():
    drifting = LoopRecord(
        op=np.sin(T / 8) * np.exp(-T / 500), pv=np.cos(T / 8) * np.exp(-T / 500), Ts=1.0
    )
    assert "no sustained" in judge(drifting, ["horch"])[0].reason
    assert judge(drifting, ["horch"], raw=True)[0].verdict == "stiction"


def test_raw_without_any_period_is_no_decision():
    verdict = judge(LoopRecord(op=T, pv=T**2, Ts=1.0), ["he"], raw=True)[0]
    assert (verdict.verdict, verdict.reason.split(";")[0]) == (
        "no_decision",
        "no period found in OP or PV",
    )


def test_too_few_samples_and_too_few_periods_are_no_decision():
    assert "too short: 40 samples" in judge(LoopRecord(**SINE).window(0, 40), ["he"])[0].reason
    few = judge(
        LoopRecord(op=np.sin(T[:130] / 8), pv=np.cos(T[:130] / 8), Ts=1.0), ["he"], raw=True
    )[0]
    assert few.verdict == "no_decision"


def test_methods_answer_in_the_order_asked():
    assert [v.method for v in judge(LoopRecord(**SINE), ["yamashita", "he", "horch"])] == [
        "yamashita",
        "he",
        "horch",
    ]


def test_methods_without_mv_never_see_it(loop):
    record = loop(**DELAYED)
    nonsense = replace(record, mv=np.random.default_rng(0).standard_normal(record.n))
    for name in ("horch", "he", "rossi_scali"):
        assert judge(record, [name]) == judge(nonsense, [name])
    assert judge(record, ["yamashita"])[0].score != judge(nonsense, ["yamashita"])[0].score


def test_verdict_does_not_depend_on_which_methods_ran_before(loop):
    record = loop(**DELAYED, kind="flow")
    names = ["kano_a", "he", "yamashita", "horch", "rossi_scali"]
    together = judge(record, names)
    assert together == [judge(record, [name])[0] for name in names]


def test_unit_of_S_is_noted_for_every_record():
    assert (
        judge(LoopRecord(op=50 + SINE["op"], pv=SINE["pv"], Ts=1.0), ["he"])[0].S_unit
        == "% of travel"
    )
    assert judge(LoopRecord(**SINE), ["he"])[0].S_unit == "OP units"


def test_every_answer_of_the_front_end_carries_regularity_and_period():
    for record in (LoopRecord(**SINE), LoopRecord(**NOISE)):
        oscillation = Prepared(record).oscillation
        indices = judge(record, ["he"])[0].indices
        assert indices["regularity"] == oscillation.regularity
        assert indices["period_s"] == pytest.approx(oscillation.period_s, nan_ok=True)


def test_unknown_process_is_noted_even_where_the_record_is_unfit():
    verdict = judge(LoopRecord(op=np.full(500, 5.0), pv=np.sin(T[:500] / 8), Ts=1.0), ["he"])[0]
    assert (verdict.verdict, verdict.applicable) == ("no_decision", None)
    assert "OP never changes" in verdict.reason
    assert "process type unknown" in verdict.reason


def test_what_was_assumed_of_the_unit_of_op_is_noted():
    inside = {**SINE, "op": 50 + SINE["op"]}
    assert "OP taken as 0..100 %" in judge(LoopRecord(**inside), ["horch"])[0].reason
    assert "unit of OP unknown" in judge(LoopRecord(**SINE), ["horch"])[0].reason
    spanned = judge(LoopRecord(**inside, op_span=(0, 100)), ["horch"])[0]
    assert "OP taken" not in spanned.reason
