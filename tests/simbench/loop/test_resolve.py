"""A loop is resolved once, and no run of it changes what the next one finds."""

import pytest

from simbench.loop import resolve
from simbench.loop.effects import EFFECTS
from simbench.loop.several_seeds import simulate_seeds
from simbench.loop.simulate import simulate
from tests.simbench.loop.test_every_effect import STRONG, same, with_effects


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


@pytest.mark.parametrize("name", EFFECTS)
def test_a_run_leaves_nothing_behind_for_the_next_one(name):
    loop = with_effects((name, STRONG[name]))
    first = simulate(loop, 3).record
    simulate(loop, 4)
    assert same(simulate(loop, 3).record, first)
    assert same(simulate(with_effects((name, STRONG[name])), 3).record, first)
