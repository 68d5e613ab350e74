"""A controller that acts otherwise than its loop file states, by no effect that is known."""

import json

import numpy as np
import pytest

from simbench.gap import diagnose
from simbench.gap.report.traces import SHOWN_LAW, compared
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
    assert SHOWN_LAW in compared(report)


def test_a_law_that_holds_is_not_replaced():
    record = simulate(Loop.from_table(STATED), 4).record.without_mv()
    report = diagnose(record, Loop.from_table(STATED))
    assert report.effect == "none"
    assert report.fixed_loop().controller.type == "PI"
