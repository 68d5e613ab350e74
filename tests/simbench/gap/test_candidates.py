"""Which effects are candidates, and in which order their proofs count."""

from dataclasses import replace

import pytest
from recorded import FLOW, LOADED, recorded

from simbench.gap.candidates import (
    find_look_alikes,
    proven,
)
from simbench.gap.intake.check import check
from simbench.scenarios.spec import Loop

SHORT = {"sampling": {"Ts": 1.0, "n": 900}}


def situation(base=FLOW, mv=False, **changes):
    r = recorded(base | {"disturbance": LOADED["disturbance"]} | SHORT, **changes)
    return check(r if mv else replace(r, mv=None), Loop.from_table(base))


@pytest.fixture(scope="module")
def plain():
    return situation()


def test_none_and_unknown_are_alone(plain):
    assert find_look_alikes("none", plain) == ("none",)
    assert find_look_alikes("unknown", plain) == ("unknown",)


def test_the_controllers_proofs_come_first():
    both = [{"name": "quantisation", "step": 0.4}, {"name": "saturation", "lo": 48.5}]
    fitted = situation(effect=both).proven
    assert list(fitted) == ["saturation", "quantisation"]
    assert fitted["saturation"]["lo"] == pytest.approx(48.5)
    assert fitted["quantisation"] == {"step": pytest.approx(0.4), "at": "loop"}
    assert proven(situation()) == {}
