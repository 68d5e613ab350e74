"""Laws that need no likelihood: silent where the baseline's law holds, exact where a term is
missing.
"""

from dataclasses import replace

import numpy as np
import pytest

from simbench.gap.discover.effect_file import lent_effect
from simbench.gap.exact import _read_off, controller_law, sensor_law, shown
from simbench.gap.intake.check import check
from simbench.gap.law import FoundLaw
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


def test_a_sound_loop_shows_no_law():
    s = situation()
    assert controller_law(s, 780) is None
    assert sensor_law(s, 780) is None
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


def test_repeats_of_pv_are_shown_where_they_stand():
    s = situation("frozen_sensor", share=0.2, length=12.0)
    law = sensor_law(s, 780)
    assert law.form == "held"
    still = np.append(False, np.diff(np.asarray(s.record.pv)) == 0.0)
    assert np.mean(still[law.on]) == 1.0
    assert "frozen_sensor" in s.proven


def test_what_is_read_off_pays_by_how_often_it_comes_in_the_part_it_was_not_learnt_from():
    often, never = np.zeros(1000, dtype=bool), np.zeros(1000, dtype=bool)
    often[::5] = True
    first, p, q = 650, 130.5 / 651, 1e-3
    onwards = 70 * np.log(p / q) + 280 * np.log((1 - p) / (1 - q))
    backwards = 130 * np.log((70.5 / 351) / q) + 520 * np.log((1 - 70.5 / 351) / (1 - q))
    law = _read_off("held", {}, often, q, first)
    assert law.nats == pytest.approx(max(onwards, backwards) - np.log(3.0))
    assert _read_off("held", {}, never, q, first).nats < 0.0


def test_one_long_run_needs_no_second_one_in_the_other_part():
    once = np.zeros(1000, dtype=bool)
    once[100:140] = True
    assert _read_off("held", {}, once, 0.1, 650).nats == pytest.approx(
        40 * np.log(10.0) - np.log(3000.0)
    )


def test_another_tuning_is_fitted_to_the_first_part_and_pays_on_the_rest():
    retuned = Loop.from_table(TABLE).with_("controller.Kc", 1.6).with_("controller.Ti", 30.0)
    law = controller_law(check(simulate(retuned, 3).record, STATED), 780)
    assert law.form == "tuning"
    assert law.numbers == pytest.approx({"gain": 1.6, "integral": 1.5}, rel=1e-3)
    assert law.nats > 100.0


def test_a_gain_that_grows_with_the_error_is_fitted_though_the_archive_stores_pv_late():
    table = {**TABLE, "noise": {"std": 0.5}}
    with lent_effect(FoundLaw("regime", {"gain": 0.0, "square": 0.4}, 0.0)) as name:
        loop = Loop.from_table({**table, "effect": [{"name": name, "gain": 0.0, "square": 0.4}]})
        record = simulate(loop, 3).record
    late = replace(record, pv=np.append(record.pv[1:], record.pv[-1]))
    law = controller_law(check(late, Loop.from_table(table)), 780)
    assert (law.form, law.late) == ("regime", 1)
    assert law.numbers == pytest.approx({"gain": 0.0, "square": 0.4}, abs=0.01)


def test_a_speed_limit_is_fitted_where_op_strays_from_a_law_that_holds_elsewhere():
    with lent_effect(FoundLaw("ramps", {"down": 10.0}, 0.0)) as name:
        record = simulate(
            Loop.from_table({**TABLE, "effect": [{"name": name, "down": 10.0}]}), 3
        ).record
    s = check(record, STATED)
    assert s.unexplained_law
    law = controller_law(s, 780)
    assert law.form == "ramps"
    assert law.numbers["down"] == pytest.approx(10.0, rel=0.05)
