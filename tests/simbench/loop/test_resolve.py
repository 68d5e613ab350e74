"""A loop is resolved once, and no run of it changes what the next one finds."""

import pytest

from simbench.loop import resolve
from simbench.loop.effects import EFFECTS
from simbench.loop.several_seeds import simulate_seeds
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from tests.simbench.loop.test_effects import STRONG, same, with_effects

ECHO = {"type": "echo", "valve": "choudhury", "S": 4.0, "J": 3.0}


@pytest.fixture
def looked_up(monkeypatch):
    """The loops whose parts were looked up, in order."""
    loops = []
    plain = resolve.look_up_parts

    def noted(loop, *more):
        loops.append(loop)
        return plain(loop, *more)

    monkeypatch.setattr(resolve, "look_up_parts", noted)
    return loops


def test_the_parts_of_a_loop_are_looked_up_once_for_all_its_seeds(looked_up):
    loop = with_effects(("extra_lag", STRONG["extra_lag"]))
    simulate_seeds(loop, 6)
    assert looked_up == [loop]


def test_an_echo_looks_up_its_donor_once(looked_up):
    loop = Loop.from_table(
        {
            **with_effects().to_table(),
            "noise": {},
            "disturbance": [ECHO],
            "sampling": {"Ts": 1.0, "n": 3000},
        }
    )
    for seed in (1, 2, 3):
        simulate(loop, seed)
    assert [found.valve.name for found in looked_up] == ["ideal", "choudhury"]


@pytest.mark.parametrize("name", EFFECTS)
def test_a_run_leaves_nothing_behind_for_the_next_one(name):
    loop = with_effects((name, STRONG[name]))
    first = simulate(loop, 3).record
    simulate(loop, 4)
    assert same(simulate(loop, 3).record, first)
    assert same(simulate(with_effects((name, STRONG[name])), 3).record, first)
