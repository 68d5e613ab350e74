"""OP whose unit nobody said is never judged as percent."""

from __future__ import annotations

import numpy as np

from simbench.detectors.example_loop import example_record
from simbench.detectors.record import LoopRecord
from simbench.verbs import detect


def test_a_share_of_one_is_asked_for_its_span():
    record = example_record("stiction", "self-regulating")
    share = LoopRecord(
        op=np.asarray(record.op) / 100.0, pv=record.pv, Ts=record.Ts, process=record.process
    )
    assert share.op_percent is None
    assert share.S_unit == "OP units"
    for _, verdict in detect(share, ["fast"]).verdicts:
        assert "--op-span" in verdict.reason
        assert verdict.S_unit == "OP units"
    known = LoopRecord(
        op=share.op, pv=share.pv, Ts=share.Ts, process=record.process, op_span=(0.0, 1.0)
    )
    whole = LoopRecord(
        op=record.op, pv=record.pv, Ts=record.Ts, process=record.process, op_span=(0.0, 100.0)
    )
    for (_, a), (_, b) in zip(
        detect(known, ["fast"]).verdicts, detect(whole, ["fast"]).verdicts, strict=True
    ):
        assert a.verdict == b.verdict, a.method
        assert a.S_unit == b.S_unit == "% of travel"


def test_what_would_open_no_valve_is_neither_a_share_nor_percent():
    pv = [1.0, 2.0, 3.0]
    assert LoopRecord(op=[3e-11, 4e-11, 5e-11], pv=pv, Ts=1.0).op_percent is None
    assert LoopRecord(op=[0.0, 0.0, 0.0], pv=pv, Ts=1.0).op_percent is not None
