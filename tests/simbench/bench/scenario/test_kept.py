"""What was just run or prepared is not run again, and is what it would be."""

import numpy as np

from simbench.bench.scenario.truth import prepare_once, run_once
from simbench.detectors.prepared import prepare
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TABLE = {
    "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "setpoint": {"value": 50, "steps": [[0, 55]]},
    "sampling": {"Ts": 1, "n": 600},
    "noise": {"std": 0.1},
}


def test_a_run_is_kept_for_its_loop_and_seed_and_is_that_of_simulate():
    loop = Loop.from_table(TABLE)
    run = run_once(loop, 3)
    assert run_once(loop, 3) is run
    assert np.array_equal(run.record.pv, simulate(loop, 3).record.pv)
    assert not np.array_equal(run_once(loop, 4).record.pv, run.record.pv)
    again = run_once(Loop.from_table(TABLE), 3)
    assert again is not run
    assert np.array_equal(again.record.pv, run.record.pv)


def test_a_record_is_prepared_once_and_without_mv():
    record = simulate(Loop.from_table(TABLE), 3).record
    prepared = prepare_once(record)
    assert prepare_once(record) is prepared
    assert prepared.record.mv is None
    assert prepared.oscillation == prepare(record.without_mv()).oscillation
