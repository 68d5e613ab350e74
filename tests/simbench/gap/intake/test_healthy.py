"""What healthy records show of a loop decides which load and noise are ordinary."""

from __future__ import annotations

import numpy as np
import pytest

from simbench.detectors.errors import ParameterError
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake import healthy as module
from simbench.gap.intake.healthy import check_healthy
from simbench.gap.intake.partial import Partial
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

BASELINE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[200.0, 55.0], [750.0, 50.0]]},
}
LOAD = {"type": "coloured", "amplitude": 0.2, "period": 10.0}
SINE = {"type": "sine", "amplitude": 1.5, "period": 90.0}
PLANT_AT_90_S = 1.2 / np.hypot(1.0, 2.0 * np.pi * 20.0 / 90.0)
loop = Loop.from_table(BASELINE)


def recorded(seed, *effects, loads=(LOAD,), **more):
    """Return a record of the loop with these effects and loads."""
    table = {**BASELINE, "disturbance": list(loads), "effect": list(effects), **more}
    return simulate(Loop.from_table(table), seed=seed).record


def learn(records, baseline):
    """Return what healthy records of a loop show."""
    return module.learn([check_healthy(record, baseline) for record in records])


@pytest.fixture(scope="module")
def healthy():
    return [recorded(seed) for seed in (1, 2)]


@pytest.mark.parametrize("stated", [0.07, 0.1, 0.15])
def test_the_noise_is_that_of_the_records_whatever_the_loop_file_states(healthy, stated):
    other = Loop.from_table({**BASELINE, "noise": {"std": stated}})
    shown = learn(healthy, other)
    assert shown.noise == pytest.approx(0.1, rel=0.05)
    assert shown.stated_in(other, 1.0).noise.std == shown.noise


def test_a_sine_that_healthy_records_have_is_known_by_period_and_size_on_pv():
    shown = learn([recorded(5, loads=(LOAD, SINE))], loop)
    (period, amplitude), *others = shown.sines
    assert not others
    assert period == pytest.approx(90.0, rel=0.01)
    # the controller does not hide it: what the load does to PV by itself is told from OP
    assert amplitude == pytest.approx(SINE["amplitude"] * PLANT_AT_90_S, rel=0.1)


@pytest.mark.parametrize(
    ("effect", "names"),
    [
        # 2.4 % of travel: less than loads of every day may drift
        ({"name": "load_drift", "rate": 0.0016, "walk": 0.0}, {"load_drift", "drift"}),
        # 6 periods: too few to be no load that wanders
        ({"name": "oscillation", "amplitude": 0.9, "period": 250.0}, {"oscillation"}),
    ],
)
def test_what_healthy_records_have_not_is_an_effect(healthy, effect, names):
    record = recorded(3, effect)
    assert diagnose(record, loop, healthy=healthy).effect in names


def test_what_healthy_records_have_is_no_effect():
    record, before = recorded(7, loads=(LOAD, SINE)), [recorded(5, loads=(LOAD, SINE))]
    assert diagnose(record, loop).effect == "oscillation"
    found = diagnose(record, loop, healthy=before)
    assert found.effect != "oscillation"
    assert found.effects[0]["probability"] < 0.5
    assert any("1 record shows noise" in note and "a sine of 90 s" in note for note in found.notes)


def test_a_record_that_is_not_healthy_is_told(healthy):
    sticky = recorded(4, valve={"model": "choudhury", "S": 6.0, "J": 2.0})
    notes = diagnose(recorded(3), loop, healthy=[healthy[0], sticky]).notes
    assert sum("itself (probability" in note for note in notes) == 1


@pytest.mark.parametrize("known", [None, Partial(loop, frozenset({"plant"}))])
def test_without_a_plant_nothing_is_learned(healthy, known):
    with pytest.raises(ParameterError, match=r"states \[plant\]"):
        diagnose(healthy[0], known, healthy=healthy[1:])


def test_the_controller_may_be_unknown(healthy):
    assert learn(healthy, Partial(loop, frozenset({"controller"}))).noise == pytest.approx(
        0.1, rel=0.05
    )


def test_coloured_noise_that_the_loop_file_states_on_pv_is_part_of_it(healthy):
    coloured = {"type": "coloured", "amplitude": 0.06, "period": 1.0, "at": "output"}
    other = Loop.from_table({**BASELINE, "disturbance": [coloured]})
    shown = learn(healthy, other)
    white = shown.stated_in(other, 1.0).noise.std
    assert np.hypot(white, 0.06) == pytest.approx(shown.noise)
