"""What the kind of a loop says of its process is used, and said."""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record

T = np.arange(600.0)


@pytest.mark.parametrize(
    ("kind", "process"),
    [("flow", "self-regulating"), ("level", "integrating"), ("pressure", None), (None, None)],
)
def test_the_kind_implies_the_process_where_it_does(kind, process):
    record = LoopRecord(op=-np.sin(T / 8), pv=np.cos(T / 8), Ts=1.0, kind=kind)
    found = repair_record(record)
    assert found.process == process
    assert [n for n in found.notes if n.startswith("process: ")] == (
        [f"process: a {kind} loop; judged as {process}, unless --process states another"]
        if process
        else []
    )
    assert repair_record(found).notes == found.notes


def test_a_stated_process_stays():
    stated = LoopRecord(
        op=-np.sin(T / 8), pv=np.cos(T / 8), Ts=1.0, kind="level", process="self-regulating"
    )
    assert repair_record(stated).process == "self-regulating"
    assert not repair_record(stated).notes
