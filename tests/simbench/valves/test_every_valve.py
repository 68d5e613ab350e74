"""Every valve model and stage on every problem; a new file in valves/ is tested here by itself."""

from __future__ import annotations

import numpy as np
import pytest
from measured_band import band_fault

from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import VALVES, Choice, valve_parameters
from simbench.loop.resolve import resolve_loop
from simbench.loop.response import valve_response
from simbench.scenarios.spec import Loop

# what a valve needs for itself alone; every other has its band and numbers by their schema
OWN = {
    "asymmetric": {"S_up": 4.0, "J_up": 2.0, "S_down": 3.0, "J_down": 1.0},
    "hysteresis": {"S": 2.0, "H": 2.0},
    "intermittent": {"S": 4.0, "J": 2.0, "period": 9.0, "on": 9.0},
    "stenman": {"d": 3.0},
}
NAMES = VALVES.names()
STICKY = [name for name in NAMES if VALVES.load(name).FRICTION]
SIZED = [name for name in NAMES if hasattr(VALVES.load(name), "for_SJ")]
UNEVEN = ("asymmetric", "characteristic", "gain_ratio", "limits", "intermittent", "time_varying")
EVEN = [name for name in NAMES if name not in UNEVEN]


def numbers(name: str, S: float = 4.0, J: float = 2.0) -> dict[str, float | str]:
    """Return parameters that a valve takes: its band, and what else must be stated."""
    band = {"S": S, "J": J}
    return {
        key: rule.names[-1] if isinstance(rule, Choice) else band.get(key, 4.0)
        for key, rule in VALVES.load(name).PARAMETERS.items()
        if rule.default is None or key in band
    }


def own(name: str) -> dict[str, float | str]:
    return OWN.get(name) or numbers(name)


def plain_and_compiled_give_the_same_bits(name, op):
    for Ts, part in ((1.0, op[:60]), (0.01, op[:100])):
        fast = valve_response(name, part, own(name), Ts)
        np.testing.assert_array_equal(fast, valve_response(name, part, own(name), Ts, plain=True))


def the_position_stays_inside_its_travel_and_op_is_left_alone(name, op):
    before = op.copy()
    mv = valve_response(name, op, own(name), 0.5)
    assert mv.min() >= 0.0
    assert mv.max() <= 100.0
    np.testing.assert_array_equal(op, before)
    assert valve_response(name, [], own(name)).size == 0


def a_sticky_valve_begins_where_op_is_within_its_travel_and_stays(name, op):
    for begin in (-7.0, 0.0, 37.0, 100.0, 108.0):
        rest = min(max(begin, 0.0), 100.0)
        mv = valve_response(name, [begin] * 4, own(name))
        np.testing.assert_allclose(mv, rest, atol=1e-9)


def the_band_that_labels_its_loops_is_the_band_it_has(name, op):
    module = VALVES.load(name)
    for S, J in ((4.0, 2.0), (7.0, 1.0)):
        p = valve_parameters(module, numbers(name, S, J), 1.0)
        band = module.mapped_SJ(p) if hasattr(module, "mapped_SJ") else (0.0, 0.0)
        assert (band[0] > 0.0) == module.FRICTION
        assert band_fault([(module, p)], *band) == ""


def asked_for_a_band_it_has_it(name, op):
    module = VALVES.load(name)
    for S, J in ((4.0, 1.5), (0.3, 0.3)):
        band = module.mapped_SJ(valve_parameters(module, module.for_SJ(S, J, 20.0), 1.0))
        jump = {"stenman": S, "hysteresis": 0.0}.get(name, J)  # the others may choose it
        assert band == pytest.approx((S, jump))


def its_friction_is_the_same_everywhere_and_both_ways(name, op):
    walk = np.clip(np.cumsum(np.random.default_rng(4).normal(0, 1.0, 150)), -8.0, 8.0)
    for Ts in (0.02, 1.0):
        middle = valve_response(name, 50.0 + walk, own(name), Ts)
        mirrored = 100.0 - valve_response(name, 50.0 - walk, own(name), Ts)
        assert mirrored == pytest.approx(middle, abs=2e-3)
        for place in (8.3, 91.7) if name in STICKY else ():
            moved = valve_response(name, place + walk, own(name), Ts)
            assert moved - place == pytest.approx(middle - 50.0, abs=2e-3)


# which valves a problem is one for
PROBLEMS = {
    plain_and_compiled_give_the_same_bits: NAMES,
    the_position_stays_inside_its_travel_and_op_is_left_alone: NAMES,
    a_sticky_valve_begins_where_op_is_within_its_travel_and_stays: STICKY,
    the_band_that_labels_its_loops_is_the_band_it_has: NAMES,
    asked_for_a_band_it_has_it: SIZED,
    its_friction_is_the_same_everywhere_and_both_ways: EVEN,
}


@pytest.mark.parametrize(
    ("problem", "name"),
    [
        pytest.param(problem, name, id=f"{name}-{problem.__name__}")
        for problem, names in PROBLEMS.items()
        for name in names
    ],
)
def test_of_every_valve(problem, name, wandering_op):
    problem(name, wandering_op)


@pytest.mark.parametrize(
    ("name", "table"), [("stiction", {"S": 4.0, "J": 1.5}), ("deadband", {"S": 4.0})]
)
def test_the_band_that_an_effect_labels_a_loop_with_is_the_band_it_makes(name, table):
    plain = {
        "plant": {"type": "foptd", "K": 1.5, "T": 20.0, "Td": 3.5},
        "controller": {"type": "PI", "Kc": 0.6, "Ti": 18.0},
        "sampling": {"Ts": 1.0, "n": 400},
    }
    assert name in PLUGINS.names()
    setup = resolve_loop(Loop.from_table({**plain, "effect": [{"name": name, **table}]}), 3)
    faults = [band_fault([stage], *band) for stage, band in zip(setup.valves, setup.bands)]
    assert faults == [""] * len(faults)
    assert max(S for S, _ in setup.bands) == 4.0
