"""How far a record is from simulations of its baseline, whose plant may be off by a tenth."""

from __future__ import annotations

import numpy as np
import pytest

from simbench.gap.closed_loop import as_given as module
from simbench.gap.closed_loop.as_given import gap_as_given
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.check import check
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

BASELINE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.1},
    "setpoint": {"steps": [[200.0, 55.0], [750.0, 50.0]]},
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 20.0}],
}


def loop(**changed):
    return Loop.from_table(BASELINE | changed)


def apart(record, baseline):
    """Return the distance of a record from a baseline that states its load as well."""
    return gap_as_given(check(record, baseline), baseline)


def test_a_twin_is_as_far_as_twins_are_from_each_other():
    far = [apart(simulate(loop(), seed).record, loop()) for seed in range(8)]
    assert 0.7 < np.median(far) < 1.3


def test_a_plant_within_what_a_baseline_may_be_off_is_no_gap_and_another_is():
    near, other = (
        np.median(
            [
                apart(simulate(loop(plant=BASELINE["plant"] | {"K": K}), seed).record, loop())
                for seed in range(6)
            ]
        )
        for K in (1.2 * 1.08, 1.2 * 1.7)
    )
    assert near < 1.4
    assert other > 2.0


def test_a_valve_that_sticks_moves_the_record_away():
    stuck = loop(valve={"model": "choudhury", "S": 4.0, "J": 2.0})
    assert apart(simulate(stuck, 3, kick=5.0).record, loop()) > 3.0


def test_a_plant_of_polynomials_is_drawn_too():
    two = loop(plant={"type": "tf", "num": [1.2], "den": [100.0, 25.0, 1.0], "Td": 2.0})
    record = simulate(two, 1).record
    assert gap_as_given(check(record, two), two) < 1.5


def test_a_loop_that_cannot_be_simulated_tells_nothing(monkeypatch):
    situation = check(simulate(loop(), 1).record, loop())
    monkeypatch.setattr(module, "run_with_seeds", lambda *given: None)
    assert gap_as_given(situation, loop()) is None


def test_what_healthy_records_show_of_the_load_is_in_the_simulations():
    sine = {"type": "sine", "amplitude": 1.5, "period": 90.0}
    records = [
        simulate(loop(disturbance=[*BASELINE["disturbance"], sine]), seed).record for seed in (7, 5)
    ]
    report = diagnose(records[0], loop(), healthy=records[1:])
    loops, load = report.behind.loops, report.behind.found.load
    assert load == ("oscillation",)
    assert loops.gap_as_given(load) < 1.5 < loops.gap_as_given(())


@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_seed_gives_the_same_number(seed):
    record = simulate(loop(), 4).record
    situation = check(record, loop())
    assert gap_as_given(situation, loop(), seed) == gap_as_given(situation, loop(), seed)
