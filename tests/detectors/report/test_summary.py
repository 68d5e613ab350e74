"""What the summary of verdicts says of methods that were not asked."""

from dataclasses import replace

import numpy as np

from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.report import summary


def test_methods_that_were_not_asked_are_no_votes():
    t = np.arange(600.0)
    still = LoopRecord(op=50 + 0 * t, pv=20 + np.random.default_rng(0).normal(0, 1, 600), Ts=1.0)
    moved = replace(still, op=50 + np.random.default_rng(1).normal(0, 1, 600))
    verdicts = judge(moved, ["horch", "he", "srinivasan"])
    assert {v.verdict for v in verdicts} == {"no_stiction"}
    assert summary.sentence(verdicts) == "3 not asked: no sustained oscillation"
    text = summary.as_text([(None, verdicts, moved)])
    assert text.count("not asked: no sustained oscillation") == 4
    assert "no stiction" not in text
    swings = LoopRecord(op=np.sin(t / 8), pv=-np.cos(t / 8), Ts=1.0)
    mixed = [*verdicts, *judge(swings, ["gbt44693"])]
    assert summary.sentence(mixed).startswith(("0 of 1 methods", "1 of 1 methods"))
    assert summary.sentence(mixed).endswith("; 3 not asked: no sustained oscillation")
