"""A change of gain in two records: a sound valve that rolls slowly is not called sticky, friction
is found, what keeps its period comes from outside, and what cannot be judged is said.
"""

import importlib
from pathlib import Path

import numpy as np
import pytest

from simbench.confirm.recorded import controller_gain
from simbench.detectors.record import LoopRecord
from simbench.gap.gain_pair import gain_change_recorded
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import load_loop

PUBLISHED = Path(__file__).parents[2] / "data" / "published"
T = np.arange(3000.0)


def wave(period: float, amplitude: float = 1.0) -> LoopRecord:
    angle = 2 * np.pi * T / period
    return LoopRecord(50 + amplitude * np.sin(angle), np.cos(angle), 1.0)


def pair(name, ratio, seed=1, **changes):
    """Return records of a published loop before and after its gain is changed."""
    loop = load_loop(PUBLISHED / f"{name}.toml").with_("sampling.n", 2500)
    for key, value in changes.items():
        loop = loop.with_(key.replace("__", "."), value)
    kick = 4.0 if name == "level_sticky" else 0.0
    gains = (loop.controller.Kc, ratio * loop.controller.Kc)
    return [
        simulate(loop.with_("controller.Kc", Kc), seed + i, kick=kick).record.without_mv()
        for i, Kc in enumerate(gains)
    ]


@pytest.mark.parametrize("ratio", [0.6, 1.4])
@pytest.mark.parametrize("seed", [1, 4, 7])
def test_a_level_that_rolls_slowly_with_a_sound_valve_is_never_called_sticky(ratio, seed):
    outcome = gain_change_recorded(*pair("level_slow", ratio, seed), ratio)
    assert outcome.verdict != "stiction"


def test_a_change_to_which_both_valves_do_alike_confirms_nothing():
    """A period that both predict within a few percent, and records that show friction."""
    outcome = gain_change_recorded(*pair("level_sticky", 1.4), 1.4)
    assert outcome.verdict == "no_decision"
    assert "the change does not tell which" in outcome.reason
    assert "by themselves the records show stiction" in outcome.reason


def test_friction_in_the_same_loop_is_found_by_what_both_records_show():
    ratio = 0.6
    records = pair("level_sticky", ratio)
    outcome = gain_change_recorded(*records, ratio)
    assert outcome.verdict == "stiction"
    assert "in simulations a sound valve" in outcome.reason
    assert "by themselves the records show stiction" in outcome.reason
    assert controller_gain(records[0]) == pytest.approx(0.35, rel=0.05)
    assert gain_change_recorded(*records).verdict == "stiction"
    assert outcome.plot().axes


def test_what_keeps_its_period_comes_from_outside():
    sine = [{"type": "sine", "amplitude": 8.0, "period": 500.0, "at": "input"}]
    outcome = gain_change_recorded(*pair("level_slow", 0.6, disturbance=sine), 0.6)
    assert outcome.verdict == "no_stiction"
    assert outcome.shift < 0.02


def test_the_period_of_two_bare_sines_claims_nothing():
    assert gain_change_recorded(wave(90.3), wave(150.7), 0.6).verdict != "stiction"


def test_the_room_of_the_tests_is_called_like_the_function_of_its_name():
    room = importlib.import_module("simbench.confirm")
    assert room(wave(90.3), wave(150.7), ratio=0.6).shift == pytest.approx(0.67, abs=0.02)
