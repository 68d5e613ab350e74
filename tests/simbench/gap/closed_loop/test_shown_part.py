"""A controller, a load or a plant that is otherwise than its loop file states, by no effect that is
known.
"""

import json

import numpy as np
import pytest

from simbench.gap import diagnose
from simbench.gap.closed_loop.copies import AS_SHOWN, shown
from simbench.gap.closed_loop.described import shown_words
from simbench.gap.report.view import SHOWN, compared
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

KC, TI, KEPT = 0.6, 30.0, 0.75
STATED = {
    "plant": {"type": "foptd", "K": 1.5, "T": 30.0, "Td": 6.0},
    "controller": {"type": "PI", "Kc": KC, "Ti": TI},
    "sampling": {"Ts": 1.0, "n": 2000},
    "noise": {"std": 0.1},
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 40.0}],
    "setpoint": {"value": 50, "steps": [[200, 52], [900, 49], [1500, 51]]},
}
# PI behind a filter of the error of first order
FILTERED = {
    "type": "tf",
    "num": [(1 - KEPT) * KC * (1 + 1 / TI), -(1 - KEPT) * KC, 0.0],
    "den": np.convolve([1.0, -1.0], [1.0, -KEPT]).tolist(),
    "dt": 1.0,
}


@pytest.fixture(scope="module")
def report():
    record = simulate(Loop.from_table(STATED | {"controller": FILTERED}), 4).record.without_mv()
    return diagnose(record, Loop.from_table(STATED))


def test_what_the_record_shows_takes_the_place_of_the_stated_law(report):
    assert (report.effect, report.block) == ("unknown", "controller")
    assert report.gap.after < 0.6 * report.gap.before
    assert report.gap.near
    assert 0.5 < report.shrinkage["value"] <= 1.0
    first = report.ranking[0]
    assert (first.gap_before, first.gap_after) == (report.gap.before, report.gap.after)
    assert "the controller is of order 2 and acts like PI: Kc = 0." in report.answer()
    assert report.nearness().startswith("It is then")
    assert json.loads(json.dumps(report.as_json(), allow_nan=False))["effect"] == "unknown"


def test_the_written_loop_has_that_law_and_the_stated_plant(report):
    loop = report.fixed_loop()
    assert loop.plant.type == "foptd"
    law = loop.controller
    static = sum(law.num) / np.cumsum(law.den)[:-1].sum()
    assert static == pytest.approx(KC / TI, rel=0.1), "the integral part is the true one's"
    assert SHOWN in compared(report)


@pytest.fixture(scope="module")
def bursts():
    """The diagnosis of a loop whose load comes in bursts."""
    rng = np.random.default_rng(4)
    # innovations of many sizes, from nearly none to thirty times the usual
    steps = (0.08 * rng.standard_t(1.7, size=2000).clip(-30, 30)).tolist()
    load = {"type": "resampled", "piece": 60.0, "output": steps, "filter": [1.0, -0.95]}
    record = simulate(Loop.from_table(STATED | {"disturbance": [load]}), 1).record.without_mv()
    return diagnose(record, Loop.from_table(STATED))


def test_a_load_of_another_kind_is_drawn_again_and_comes_nearer(bursts):
    assert bursts.effect == "unknown"
    assert bursts.gap.after < 0.5 * bursts.gap.before
    assert bursts.answer().endswith("a load that is drawn again from the record stands for it.")
    assert any("what the record shows removes" in line for line in bursts.gap_lines())
    loop = bursts.fixed_loop()
    assert (loop.plant.type, loop.controller.type) == ("foptd", "PI")
    assert [one["type"] for one in loop.to_table()["disturbance"]] == ["resampled"]


def test_each_part_has_its_words(bursts):
    copy = bursts.behind.shown
    assert "load is of another kind" in shown_words(copy, "disturbance")
    assert shown_words(copy, "controller") == "the controller is PI: Kc = 0.6, Ti = 30 s"
    as_shown = copy._replace(plant=AS_SHOWN)
    assert shown_words(as_shown, "process").startswith("the plant is of first order: K = ")


def test_a_stated_sensor_leaves_the_load_as_it_is(bursts):
    lagging = STATED | {"effect": [{"name": "sensor_lag", "tau": 5.0}]}
    found = bursts.behind.found.situation
    assert list(shown(found, Loop.from_table(lagging), "disturbance")) == []
    # but for one that rounds, as every card does
    rounding = STATED | {"effect": [{"name": "quantisation", "step": 0.05}]}
    assert list(shown(found, Loop.from_table(rounding), "disturbance"))
