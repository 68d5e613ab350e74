"""All effects on one record: what looks alike agrees with the judge, and what could be seen is as
large as is said.
"""

from dataclasses import replace

import pytest
from recorded import FLOW, LOADED, recorded

from simbench.gap.candidates import (
    find_look_alikes,
    fit_candidates,
    possible_effects,
    proven,
)
from simbench.gap.effects import recogniser
from simbench.gap.intake.check import check
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import size_penalty
from simbench.gap.situation import load_memory
from simbench.loop.effects import block_of
from simbench.scenarios.spec import Loop

SHORT = {"sampling": {"Ts": 1.0, "n": 900}}
VESSEL = FLOW | {
    "plant": {"type": "integrating", "K": 0.05, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 1.2, "Ti": 60},
}


def situation(base=FLOW, mv=False, **changes):
    r = recorded(base | {"disturbance": LOADED["disturbance"]} | SHORT, **changes)
    return check(r if mv else replace(r, mv=None), Loop.from_table(base))


@pytest.fixture(scope="module")
def plain():
    return situation()


def test_none_and_unknown_are_alone(plain):
    assert find_look_alikes("none", plain) == ("none",)
    assert find_look_alikes("unknown", plain) == ("unknown",)


def test_what_cannot_be_is_not_fitted(plain):
    assert "time_constant_mismatch" in possible_effects(plain)
    assert "time_constant_mismatch" not in possible_effects(situation(VESSEL))
    assert not [e for e in possible_effects(situation(mv=True)) if block_of(e) == "valve"]
    held = situation(FLOW | {"valve": {"model": "deadband", "S": 0.5}})
    assert "stiction" not in possible_effects(held)
    assert "deadband" in possible_effects(held)


def test_the_controllers_proofs_come_first():
    both = [{"name": "quantisation", "step": 0.4}, {"name": "saturation", "lo": 48.5}]
    fitted = situation(effect=both).proven
    assert list(fitted) == ["saturation", "quantisation"]
    assert fitted["saturation"]["lo"] == pytest.approx(48.5)
    assert fitted["quantisation"] == {"step": pytest.approx(0.4), "at": "loop"}
    assert proven(situation()) == {}


def jump(amplitude, start):
    """Return a load step: a ramp of one sample."""
    return {"type": "ramp", "amplitude": amplitude, "period": 1.0, "start": start}


def test_jumps_of_a_load_that_wanders_are_an_event():
    s = situation(
        disturbance=[*LOADED["disturbance"], jump(3.0, 150), jump(4.0, 360), jump(3.5, 600)]
    )
    engine = Engine(s.data, load_memory(s))
    bare = engine.base()
    jumping = fit_candidates(engine, bare, ["load_steps"])["load_steps"]
    assert not recogniser("load_steps").ordinary(jumping.fit, s)


def test_a_candidate_gains_what_its_fit_brought_less_the_price_of_its_numbers(plain):
    engine = Engine(plain.data, load_memory(plain))
    base = engine.base()
    one = fit_candidates(engine, base, ["gain_mismatch"])["gain_mismatch"]
    brought = one.fit.loglik - base.loglik
    assert one.log_likelihood_gain == pytest.approx(brought - size_penalty(plain.data.n, 1.0))
