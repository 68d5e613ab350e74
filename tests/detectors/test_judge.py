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
