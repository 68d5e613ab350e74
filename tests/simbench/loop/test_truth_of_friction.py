"""Whether a valve sticks is asked of what it maps on, whatever it and its numbers are called and
wherever it acts.
"""

import pytest

from simbench.bench.scenario.truth import healthy_twin, least_swing
from simbench.loop.parameters import VALVES
from simbench.loop.resolve import friction, resolve_loop
from simbench.scenarios.spec import Loop

PLAY = '''"""A play whose only number is called h."""
from simbench.loop.parameters import Number
SOURCE = "a test"
FRICTION = True
PARAMETERS = {"h": Number("% of travel", low=0.0, high=100.0, says="width")}


def start(u0, p):
    return (u0,)


def step(u, state, p):
    return (max(u - p.h / 2, min(u + p.h / 2, state[0])),)


def mapped_SJ(p):
    return p.h, 0.0
'''


@pytest.fixture(scope="module")
def play(tmp_path_factory):
    path = tmp_path_factory.mktemp("valves") / "play_called_h.py"
    path.write_text(PLAY)
    yield VALVES.add_file(path)
    VALVES._files.clear()


def loop(valve=None, *effects):
    table = {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "sampling": {"Ts": 1, "n": 200},
        "valve": valve or {"model": "ideal"},
        "effect": list(effects),
    }
    return Loop.from_table(table)


@pytest.mark.parametrize(("h", "sticky"), [(0.0, False), (3.0, True)])
def test_a_play_sticks_by_its_width_and_not_by_its_letter(play, h, sticky):
    assert resolve_loop(loop({"model": play, "h": h}), 0).sticky is sticky
    assert friction(loop({"model": play, "h": h})) == ([(h, 0.0)] if sticky else [])


def test_friction_in_front_of_a_valve_and_in_an_effect_counts_and_its_healthy_twin_has_none(play):
    lag = {"name": "valve_lag", "tau": 3.0}
    in_front = loop({"model": "lag", "T": 1.0, "before": [{"model": play, "h": 6.0}]}, lag)
    assert friction(in_front) == [(6.0, 0.0)]
    assert least_swing(in_front) == 0.3
    by_effect = loop(None, {"name": "stiction", "S": 4.0, "J": 2.0}, lag)
    assert friction(by_effect) == [(4.0, 2.0)]
    assert least_swing(by_effect) == 1.0
    for sticky in (in_front, by_effect):
        assert resolve_loop(sticky, 0).sticky
        twin = healthy_twin(sticky)
        assert not resolve_loop(twin, 0).sticky
        assert [e.name for e in twin.effect] == ["valve_lag"]


def test_an_effect_of_no_strength_sticks_no_valve():
    assert not resolve_loop(loop(None, {"name": "stiction", "S": 0.0, "J": 0.0}), 0).sticky
