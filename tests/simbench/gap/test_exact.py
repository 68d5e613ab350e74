"""Terms shown without a likelihood: none where the baseline's law holds, else the missing one."""

import numpy as np
import pytest

from simbench.gap.exact import controller_term, frozen, shown
from simbench.gap.intake.check import check
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TABLE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1200},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[300, 54], [800, 49]]},
}
STATED = Loop.from_table(TABLE)


def situation(effect=None, **numbers):
    effects = [] if effect is None else [{"name": effect, **numbers}]
    return check(simulate(Loop.from_table({**TABLE, "effect": effects}), 3).record, STATED)


def test_a_sound_loop_shows_no_term():
    s = situation()
    assert controller_term(s, 780) is None
    assert frozen(s, 780) is None
    assert shown(s, "derivative") is None


@pytest.mark.parametrize(("effect", "numbers", "form"), [
    ("derivative_action", {"Td": 8.0, "filter": 1.0}, "derivative"),
    ("missed_executions", {"share": 0.3, "length": 8.0}, "idle"),
])  # fmt: skip
def test_a_term_of_the_controller_is_shown_with_its_numbers(effect, numbers, form):
    s = situation(effect, **numbers)
    shown_numbers = shown(s, form)
    assert shown_numbers is not None
    assert shown_numbers[next(iter(numbers))] == pytest.approx(
        next(iter(numbers.values())), rel=0.35
    )
    assert effect in s.proven


def test_repeats_of_pv_are_shown_with_their_share():
    s = situation("frozen_sensor", share=0.2, length=12.0)
    term = frozen(s, 780)
    still = np.append(False, np.diff(np.asarray(s.record.pv)) == 0.0)
    assert (term.name, term.numbers["share"]) == ("held", pytest.approx(still.mean(), abs=0.02))
    assert "frozen_sensor" in s.proven


def test_another_tuning_shows_no_term():
    retuned = Loop.from_table(TABLE).with_("controller.Kc", 1.6).with_("controller.Ti", 30.0)
    s = check(simulate(retuned, 3).record, STATED)
    assert s.law.tuning is not None
    assert controller_term(s, 780) is None
