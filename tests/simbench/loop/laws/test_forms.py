"""Every form of law does nothing at rest, something with its numbers, and the same compiled as
sample by sample.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import ParameterError
from simbench.loop.laws import LAW_FORMS, apply_law, law_parameters
from simbench.loop.laws.forms import spells
from simbench.loop.parameters import resolve
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
        "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
        "sampling": {"Ts": 1.0, "n": 400},
        "noise": {"std": 0.1},
        "setpoint": {"value": 50.0, "steps": [[100, 55], [250, 50]]},
    }
)
NUMBERS = {
    "curve": {"q1": 45, "q2": 50, "q3": 55, "k1": 0.5, "k2": -0.3, "k3": 0.2},
    "memory": {"S": 4, "J": 1},
    "rate": {"slowness": 4},
    "size": {"gain": 1.5, "pace": 1.3, "delay": 1},
    "zero": {"lead": -5, "lag": 3},
    "held": {"share": 0.2, "length": 10},
    "clipped": {"low": 49, "high": 51},
    "stairs": {"step": 0.5},
    "rough": {"std": 1.0, "share": 0.3, "length": 20},
    "derivative": {"Td": 3, "filter": 1},
    "weight": {"weight": 0.4},
    "regime": {"gain": 0.5, "square": 0.3, "side": 0.2, "schedule": 0.01},
    "ramps": {"down": 2, "up": 3},
    "idle": {"share": 0.3, "length": 4},
    "limits": {"low": 48, "high": 52},
    "rest": {"width": 0.5, "step": 0.2},
    "tuning": {"gain": 1.5, "integral": 0.7},
    "bursts": {"std": 3, "time": 5, "share": 0.3, "length": 50},
}


def ran(form=None, numbers=None, *, plain=False):
    setup = resolve_loop(LOOP, 1)
    if form is not None:
        apply_law(
            form,
            setup,
            resolve(law_parameters(form), numbers or {}, form),
            np.random.default_rng(2),
        )
    return run_setup(setup, plain=plain).record


def test_every_form_is_tried_here():
    assert NUMBERS.keys() == LAW_FORMS.keys()


@pytest.mark.parametrize("form", LAW_FORMS)
def test_a_form_does_nothing_at_rest_and_something_with_its_numbers(form):
    bare, still, moved = ran(), ran(form), ran(form, NUMBERS[form])
    assert np.array_equal(still.pv, bare.pv)
    assert np.array_equal(still.op, bare.op)
    assert not np.array_equal(moved.pv, bare.pv)
    assert not np.array_equal(moved.op, bare.op)


@pytest.mark.parametrize("form", ["curve", "derivative", "idle", "held", "clipped"])
def test_the_compiled_step_gives_the_bits_of_the_plain_one(form):
    compiled, plain = ran(form, NUMBERS[form]), ran(form, NUMBERS[form], plain=True)
    assert np.array_equal(compiled.pv, plain.pv)
    assert np.array_equal(compiled.op, plain.op)


def test_op_stands_in_idle_spells_and_pv_in_held_ones():
    assert np.mean(np.diff(ran("idle", NUMBERS["idle"]).op) == 0.0) > 0.15
    assert np.mean(np.diff(ran("held", NUMBERS["held"]).pv) == 0.0) > 0.05


def test_laws_of_one_block_add_up():
    setup = resolve_loop(LOOP, 1)
    for form in ("derivative", "ramps"):
        apply_law(
            form,
            setup,
            resolve(law_parameters(form), NUMBERS[form], form),
            np.random.default_rng(0),
        )
    du = np.diff(run_setup(setup).record.op)
    assert du.max() <= 1 / 3 + 1e-9
    assert du.min() >= -1 / 2 - 1e-9


def test_ends_in_the_wrong_order_are_refused():
    with pytest.raises(ParameterError, match="must be below"):
        ran("limits", {"low": 60.0, "high": 40.0})


def test_spells_fill_their_share():
    setup = SimpleNamespace(sp=np.zeros(200_000), Ts=2.0)
    drawn = spells(setup, SimpleNamespace(share=0.25, length=40.0), np.random.default_rng(0))
    assert abs(drawn.mean() - 0.25) < 0.03
    assert (
        spells(setup, SimpleNamespace(share=0.0, length=5.0), np.random.default_rng(0)).sum() == 0.0
    )
