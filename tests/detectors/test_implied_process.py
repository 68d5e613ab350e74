"""A process that is stated is not replaced by what the kind of loop implies."""

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record

T = np.arange(600.0)


def test_a_stated_process_stays():
    stated = LoopRecord(
        op=-np.sin(T / 8), pv=np.cos(T / 8), Ts=1.0, kind="level", process="self-regulating"
    )
    assert repair_record(stated).process == "self-regulating"
    assert not repair_record(stated).notes
