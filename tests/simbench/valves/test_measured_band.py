"""What a valve maps on, which is the label of a loop, is measured under an OP that creeps."""

import pytest
from measured_band import band_fault

from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import VALVES, Choice, valve_parameters
from simbench.loop.resolve import resolve_loop
from simbench.scenarios.spec import Loop

SIZES = [(4.0, 2.0), (7.0, 1.0)]


def tables(module) -> list[dict[str, float | str]]:
    """Return sets of parameters that a valve takes: its band, and what else must be stated."""
    needed = {
        name: rule.names[-1] if isinstance(rule, Choice) else 4.0
        for name, rule in module.PARAMETERS.items()
        if rule.default is None or name in ("S", "J")
    }
    bands = ({"S": S, "J": J} for S, J in SIZES)
    return [needed | {k: v for k, v in band.items() if k in needed} for band in bands]


@pytest.mark.parametrize("name", VALVES.names())
def test_every_valve_does_what_it_maps_on(name):
    module = VALVES.load(name)
    for table in tables(module):
        p = valve_parameters(module, table, 1.0)
        S, J = module.mapped_SJ(p) if hasattr(module, "mapped_SJ") else (0.0, 0.0)
        assert (S > 0.0) == module.FRICTION
        assert band_fault([(module, p)], S, J) == "", table


@pytest.mark.parametrize(
    ("name", "table"), [("stiction", {"S": 4.0, "J": 1.5}), ("deadband", {"S": 4.0})]
)
def test_every_effect_with_a_valve_stage_does_what_it_maps_on(name, table):
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
