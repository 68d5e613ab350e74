"""Grid plant: every valve is a member of it with the band that its cell asks for."""

import math

import numpy as np
import pytest

from simbench.bench.scenario.resolve import band, resolve, valve_table
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import VALVES
from simbench.scenarios.grid import make_grid

DEAD_BANDS = ("deadband", "coulomb_viscous", "hysteresis")
MORE = {
    "deadzone": {"parameters": {"D": 0.5}, "scale": {"D": "S"}},
    "lag": {"parameters": {"T": [0.02, 0.05]}, "scale": {"T": "period"}},
    "characteristic": {"parameters": {"type": ["linear", "equal_percentage"]}},
    "gain_ratio": {"parameters": {"R": 2.0}},
}
EFFECTS = {"archive": {"name": "compression", "parameters": {"band": 0.2}, "scale": {"band": "pv"}}}
DRAW = {
    "K": 1.0,
    "T": 10.0,
    "S": 4.0,
    "samples_per_period": 30.0,
    "periods": 20.0,
    "step": 0.8,
    "noise_ratio": 0.1,
}


def shape(valve):
    return math.inf if valve in DEAD_BANDS else 0.5 if valve == "stenman" else 1.0


def one_cell(valves, **changes):
    settings = {"mv_noise": 0.02, "moves": 3.0, "move": 2.0, "effect": "archive", **changes}
    names = (valves,) if isinstance(valves, str) else tuple(valves)
    block = {
        "name": "a",
        "axes": {"Td_over_T": [0.3], "S_over_2J": [shape(names[0])]},
        "member": [{"name": name, "valve": name} for name in names],
    }
    grid = make_grid(
        {
            "title": "t",
            "draw": {**DRAW, **settings},
            "valves": MORE,
            "effects": EFFECTS,
            "block": [block],
        }
    )
    return resolve(grid.group(0))


@pytest.mark.parametrize("valve", VALVES.names())
def test_every_valve_file_is_a_member_with_the_band_that_its_cell_asks_for(valve):
    (scenario,) = one_cell(valve)
    module, loop = VALVES.load(valve), scenario.loop
    assert loop.valve.name == scenario.tags["valve"] == valve
    if module.FRICTION:
        ratio = shape(valve)
        assert band(loop) == pytest.approx((4.0, 4.0 / (2.0 * ratio)), rel=1e-9)
        assert scenario.tags["S_over_2J"] == ratio
    else:
        assert (scenario.tags["S_over_2J"], scenario.tags["S"]) == (0.0, 0.0)
    run, cycled = simulate_with_truth(loop, scenario.seed)
    assert run.sticky == module.FRICTION
    assert cycled.answer == "no" or module.FRICTION


@pytest.mark.parametrize(
    ("valve", "J"),
    [("stenman", 2.0), ("deadband", 1.0), ("hysteresis", 1.0), ("coulomb_viscous", 2.0)],
)
def test_a_band_that_a_valve_cannot_have_is_one_sentence(valve, J):
    with pytest.raises(
        ParameterError, match=f"valve {valve!r} cannot have S = 5 %, J = .*: nearest is S = "
    ):
        valve_table(valve, {"S": 5.0, "J": J}, 100.0, {})


def test_siblings_share_everything_but_the_valve():
    sticky, healthy = one_cell(["choudhury", "ideal"])
    assert sticky.loop.model_copy(update={"valve": healthy.loop.valve}) == healthy.loop
    assert len(sticky.loop.setpoint.steps) == 4
    assert [e.name for e in sticky.loop.effect] == ["compression"]
    assert sticky.loop.noise.mv_std == 0.08
    assert np.std([value for _, value in sticky.loop.setpoint.steps[1:]]) > 0
