"""What every room is told of a record: facts and the memory of an ordinary load, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.controller.law import Law
from simbench.gap.effects import recogniser
from simbench.gap.likelihood.model import Data
from simbench.gap.situation import Archive, Situation, load_memory
from simbench.scenarios.spec import Loop

N = 1000
PV, OP = np.resize([1.0, -1.0], N), 50.0 + np.resize([0.0, 1.0, 1.0], N)
SWING = 50.0 + np.resize([1.0, 0.0, -1.0, 0.0], N)
FOPTD = {"type": "foptd", "K": 2.0, "T": 30.0, "Td": 6.0}
VESSEL = {"type": "integrating", "K": 0.05, "Td": 6.0}


def situation(*, straight=0.9, plant=FOPTD, op=OP, valve=None, law=None, archive=None, **fit):
    fit = {"K": 2.0, "T": 15.0, "Td": 3.0, "n": N} | fit
    table = {
        "plant": plant,
        "controller": {"type": "PI", "Kc": 0.5, "Ti": 20.0},
        "sampling": {"Ts": 2.0},
        "noise": {"std": 0.1},
    }
    record = LoopRecord(op=op, pv=PV, Ts=2.0, tag="FIC1")
    zero = np.zeros(fit["n"])
    data = Data(zero, zero, fit["K"], fit["T"], fit["Td"], 0.1)
    return Situation(
        record=record,
        baseline=Loop.from_table(table | ({"valve": valve} if valve else {})),
        trusted=True,
        tuned=True,
        op=op,
        sp=np.zeros(N),
        noise=0.1,
        law=law or Law(0.0, 0.5, 20.0),
        samples=SimpleNamespace(straight=straight),
        archive=archive or Archive(),
        data=data,
    )


@pytest.mark.parametrize(
    ("K", "memory"), [(0.1, 4 * (3.0 + 20.0)), (-0.1, 4 * (3.0 + 20.0)), (0.0, 200.0)]
)
def test_a_vessels_time_scale_is_its_loops(K, memory):
    # at Kc = 0.5 and K a sample the loop's is 1 / (K Kc) beside the dead time
    assert load_memory(situation(plant=VESSEL, T=0.0, K=K)) == pytest.approx(memory)


@pytest.mark.parametrize(
    ("archive", "law", "facts"),
    [
        ({}, {}, set()),
        ({"rounding": (0.5, "loop")}, {}, {"quantisation"}),
        ({"band": 0.1}, {}, {"compression"}),
        ({"spikes": (0.01, 2.0, "loop")}, {}, {"outliers"}),
        ({}, {"limits": (0.0, 60.0)}, {"saturation"}),
        ({}, {"gap": 0.1}, {"error_deadband"}),
        ({}, {"step": 0.1}, {"op_quantisation"}),
        ({}, {"tuning": (2.0, 1.0)}, {"detuning"}),
    ],
)
def test_every_fact_is_an_effects_and_nothing_shows_where_there_is_none(archive, law, facts):
    s = situation(archive=Archive(**archive), law=Law(0.0, 0.5, 20.0, **law))
    assert set(s.facts) == facts
    assert all(recogniser(effect).proven(s) for effect in facts - {"op_quantisation"})
    assert s.archive.faithful == (not archive)


def test_a_baselines_valve_is_no_gap():
    held = situation(op=SWING, valve={"model": "deadband", "S": 1.6})
    assert held.expected_band == 1.6
    assert situation(valve={"model": "choudhury", "S": 1.6, "J": 0.5}).expected_band == 0.0
    assert situation(valve={"model": "choudhury", "S": 1.6, "J": 0.0}).expected_band == 1.6
    assert situation().expected_band == 0.0
