"""A span that is another signal's never turns a verdict without a word."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record

K = np.arange(900.0)
OP, PV = 50.0 + 6.0 * np.sin(K / 8), 30.0 + 5.0 * np.sign(np.sin(K / 8 - 1)) + 0.1 * np.sin(7.1 * K)
WRONG = [(0.0, 1.0), (60.0, 70.0), (0.0, 40.0), (-1000.0, -900.0)]


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "rec.csv"
    np.savetxt(path, np.column_stack([K, OP, PV]), delimiter=",", header="t,op,pv", comments="")
    return path


@pytest.mark.parametrize("span", WRONG)
@pytest.mark.parametrize("name", ["op", "pv"])
def test_a_record_outside_its_span_is_refused_and_both_are_noted(file, name, span):
    if name == "pv" and span == (0.0, 40.0):
        return  # PV lies in it
    with pytest.raises(
        RecordError,
        match=rf"{name.upper()} lies outside {name}_span {span[0]:g} to {span[1]:g} in .* needed",
    ):
        read_record(file, **{f"{name}_span": span})


@pytest.mark.parametrize("span", WRONG)
def test_a_record_at_hand_outside_its_span_is_judged_by_no_method(span):
    record = LoopRecord(op=OP, pv=PV, Ts=1.0)
    assert judge(record, ["procedure"])[0].verdict == "stiction"
    for verdict in judge(
        replace(record, op_span=span), ["procedure", "horch", "kano_a", "ellipse"]
    ):
        assert verdict.verdict == "no_decision"
        assert "outside" in verdict.reason or not verdict.applicable


def test_what_goes_a_little_beyond_its_span_is_noted_and_judged(file):
    record = read_record(file, op_span=(0, 55.5))
    assert [
        n for n in record.notes if n.startswith("span: OP lies outside op_span 0 to 55.5 in 13")
    ]
    assert judge(record, ["procedure"])[0].verdict == "stiction"
    assert not read_record(file, op_span=(0, 100)).notes
