"""The slave of a cascade whose set point is not on record is recognised; a loop that holds its set
point, and one under P control, are not.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simbench.detectors.records.io import read_record
from simbench.gap.stiction.cascade import slave_note
from simbench.gap.stiction.conclusion import judged
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

PUBLISHED = Path(__file__).parents[3] / "data" / "published"
LOOP = {
    "plant": {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 0.8, "Ti": 10.0},
    "noise": {"std": 0.3},
    "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 20.0}],
    "sampling": {"Ts": 1.0, "n": 3000},
}


def record(**more):
    return replace(simulate(Loop.from_table(LOOP | more), 5).record.without_mv(), sp=None)


@pytest.mark.parametrize("name", ["idv0_3s", "idv0_15s", "idv0_60s"])
def test_the_cooling_water_of_the_tennessee_eastman_process_is_a_slave(name):
    found = judged(read_record(PUBLISHED / f"{name}.csv"))[0]
    assert "slave of a cascade" in found.reason


def test_a_set_point_that_wanders_unseen_is_recognised_and_one_on_record_is_not():
    t = np.arange(3000.0)
    sp = 50.0 + 4.0 * np.sin(t / 200.0) + 3.0 * np.sin(t / 90.0)
    steps = [[float(a), float(b)] for a, b in zip(t, sp)]
    unseen = record(setpoint={"value": 50.0, "steps": steps})
    assert "slave of a cascade" in slave_note(unseen)
    assert slave_note(replace(unseen, sp=sp)) == ""


@pytest.mark.parametrize("controller", [LOOP["controller"], {"type": "P", "Kc": 0.8}])
def test_a_loop_that_holds_its_set_point_is_no_slave(controller):
    assert slave_note(record(controller=controller)) == ""
