"""A corrected loop rests where the record lies."""

import os
from types import SimpleNamespace

import numpy as np
import pytest

from results.studies.withheld.files import write_item
from results.studies.withheld.making import STRENGTHS
from results.studies.worlds import NAMES, load_world
from simbench.detectors.records.io import read_record
from simbench.gap import diagnose
from simbench.gap.closed_loop.level import level
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, load_loop

TABLE = {
    "plant": {"type": "foptd", "K": 2.0, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 0.4, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.2},
    "setpoint": {"value": 60.0, "steps": [[100.0, 64.0]]},
    "operating_point": {"op0": 55.0, "pv0": 60.0},
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 20.0}],
}


@pytest.mark.parametrize("controller", [TABLE["controller"], {"type": "P", "Kc": 0.4}])
def test_a_loop_begun_elsewhere_is_moved_to_the_level_of_the_record(controller):
    true = Loop.from_table({**TABLE, "controller": controller})
    record = simulate(true, seed=3).record
    moved = true.with_all({"operating_point.op0": 46.0})
    levelled = level(SimpleNamespace(op=record.op, record=record), moved, 0.0)
    again = simulate(levelled, seed=50).record
    assert abs(again.op.mean() - record.op.mean()) < 0.3 * np.std(record.op)
    assert abs(again.pv.mean() - record.pv.mean()) < 0.3 * np.std(record.pv)
    before = simulate(moved, seed=50).record
    assert abs(before.op.mean() - record.op.mean()) > np.std(record.op)


COUNT = int(os.environ.get("RECORDS", "12"))
RUNS = 8  # whose means are averaged: each has a load of its own
LACKING = (
    "stiction",
    "valve_lag",
    "gain_mismatch",
    "noise",
    "sensor_lag",
    "detuning",
    "load_steps",
)
SEED = 432


def off_level(place, number):
    """Return how far the means of a corrected loop lie from its record's OP and PV, in standard
    deviations of the record.
    """
    effect, strength = (
        LACKING[number % len(LACKING)],
        STRENGTHS[number // len(NAMES) % len(STRENGTHS)],
    )
    asked = {"kind": "single", "effect": effect, "strength": strength, "mv": False}
    item = load_world(NAMES[number % len(NAMES)]).draw(SEED, number, asked)
    place.mkdir()
    file, baseline = write_item(item, place, "loop")
    record = read_record(file)
    report = diagnose(record, load_loop(baseline))
    loop = report.fixed_loop()
    runs = [simulate(loop, seed=100 + i).record for i in range(RUNS)]
    pairs = (
        (np.mean([getattr(run, name).mean() for run in runs]), getattr(record, name))
        for name in ("op", "pv")
    )
    return max(abs(mean - signal.mean()) / signal.std() for mean, signal in pairs)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_corrected_loops_of_three_simulators_rest_where_their_records_do(tmp_path):
    off = [off_level(tmp_path / str(number), number) for number in range(COUNT)]
    print(np.round(off, 2))
    assert np.mean(np.array(off) < 0.3) >= 0.95 - 0.5 / COUNT
