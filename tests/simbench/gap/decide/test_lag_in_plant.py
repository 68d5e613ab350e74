"""MV shows a valve's lag; PV tells whether the simulation lacks it, or has it in its plant."""

import pytest

from simbench.gap import diagnose
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TAU = 6.0


def loop(Td, *effects, T=20.0):
    return Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1, "T": T, "Td": Td},
            "controller": {"type": "PI", "Kc": 1.2, "Ti": 20},
            "sampling": {"Ts": 1, "n": 1500},
            "noise": {"std": 0.05},
            "setpoint": {"steps": [[200, 54], [600, 48], [1000, 52]]},
            "disturbance": [{"type": "coloured", "at": "input", "amplitude": 1.0, "period": 20.0}],
            "effect": list(effects),
        }
    )


@pytest.fixture(scope="module")
def record():
    return simulate(loop(4.0, {"name": "valve_lag", "tau": TAU}), 2).record


def test_a_lag_that_the_plant_lacks_is_named(record):
    report = diagnose(record, loop(4.0))
    assert report.effect == "valve_lag"
    assert report.effects[0]["parameters"]["tau"] == pytest.approx(TAU, rel=0.05)


def test_a_lag_that_was_identified_with_the_plant_is_no_gap(record):
    # the first-order plant whose step response is nearest to both lags together
    report = diagnose(record, loop(8.56, T=21.9))
    assert report.effect == "none"
    chances = {row.effect: row.probability for row in report.ranking}
    assert chances["valve_lag"] < 0.2
    # MV shows as well that nothing else is wrong with the valve
    assert sum(chances[e] for e in ("stiction", "deadband", "slew_limit", "deadzone")) < 0.05
