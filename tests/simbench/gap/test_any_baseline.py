"""Baselines of higher order, and the inner loop of a cascade as the record."""

import pytest

import simbench as sb
from simbench.detectors.errors import UserError
from simbench.scenarios.errors import SpecError

BASE = {
    "plant": {"type": "tf", "num": [1.2], "den": [60, 17, 1], "Td": 2.0},
    "controller": {"type": "PI", "Kc": 0.8, "Ti": 15},
    "sampling": {"Ts": 1, "n": 800},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50, "steps": [[100, 55], [350, 48], [600, 53]]},
    "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 40.0}],
}


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [pytest.param("none", {}, marks=pytest.mark.slow), ("gain_mismatch", {"factor": 1.6})],
)
def test_a_second_order_baseline_is_no_gap_and_hides_none(effect, parameters):
    record = (
        sb.Loop(**BASE, effect=[{"name": effect, **parameters}] if parameters else [])
        .simulate(3)
        .record
    )
    assert sb.gap.diagnose(record, sb.Loop(**BASE)).effect == effect


@pytest.mark.slow
def test_the_inner_loop_of_a_cascade_is_judged_from_its_record():
    inner = {
        **BASE,
        "setpoint": {"value": 50},
        "plant": {"type": "foptd", "K": 1.2, "T": 6, "Td": 2},
    }
    outer = {
        "plant": {"type": "foptd", "K": 1.0, "T": 60, "Td": 5},
        "controller": {"type": "PI", "Kc": 1, "Ti": 60},
        "setpoint": {"value": 50, "steps": [[100, 55], [450, 47]]},
    }
    loop = sb.Loop(**inner, outer=outer)
    run = sb.Loop(**inner, outer=outer, effect=[{"name": "gain_mismatch", "factor": 1.8}]).simulate(
        2
    )
    assert sb.gap.diagnose(run, loop).effect == "gain_mismatch"


def test_a_plant_without_a_model_is_no_baseline():
    record = sb.Loop(**BASE).simulate(3).record
    with pytest.raises((SpecError, UserError), match="tank"):
        sb.gap.diagnose(record, sb.Loop(**{**BASE, "plant": {"type": "tank", "K": 1.2, "T": 10}}))
