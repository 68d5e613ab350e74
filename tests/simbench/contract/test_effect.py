"""An effect's contract: every built-in keeps it, and each way of breaking it is caught."""

import pytest

from simbench.contract.effect import EFFECT_RULES, no_strength, strengths
from simbench.loop.effects import PLUGINS

BIAS = '''"""Bias: the transmitter reads too much."""
import sys

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "a test"
BLOCK = "sensor"
SIZE = Number("PV units", low=0.0, high=10.0, identity=0.0, says="what is read too much")
PARAMETERS = {"size": SIZE}
ACTS = "loop"


def apply(setup, p, rng):
    setup.pv_add += p.size
'''
STAGE = """

def start(u0, p):
    return (u0,)


def step(u, state, p):
    return (max(u - 2.0, min(u + 2.0, state[0])),)
"""
ADDED = "    setup.pv_add += p.size\n"
BROKEN = [
    (
        ADDED,
        "    setup.pv_add += 0.1 + p.size\n",
        "is not the identity at no strength: the record changes at size = 0",
    ),
    (ADDED, "    setup.pv_add += 0.0 * p.size\n", "does nothing at any strength tried"),
    (ADDED, "    setup.pv_add += p.size * np.random.random()\n", "is not deterministic"),
    (ADDED, "    if p.size > 0.0:\n        print(p.size)\n", "prints '0.4', at size = 0.4"),
    (ADDED, "    setup.pv_add += p.size / p.size\n", "raises ZeroDivisionError"),
    (
        ADDED,
        ADDED + "    setup.sp[4]\n",
        "out of bounds for axis 0 with size 3), in a loop of 3 samples",
    ),
    (
        ADDED,
        "    if p.size > 0.0:\n        setup.pv_add[3:] = np.nan\n",
        "finite numbers are needed",
    ),
    ('ACTS = "loop"', 'ACTS = "record"', "says ACTS = 'record', but OP changes too"),
    (
        ADDED,
        "    setup.recorders.append(lambda pv: pv + p.size)\n",
        "says ACTS = 'loop', but OP stays as it was",
    ),
    ('ACTS = "loop"', 'ACTS = "plant"', "ACTS = 'plant', allowed: loop, record"),
    ('BLOCK = "sensor"', 'BLOCK = "actuator"', "BLOCK = 'actuator', allowed: controller, valve"),
    (
        "identity=0.0",
        "identity=20.0",
        "identity = 20; a value in 0..10 that does nothing is needed",
    ),
    ("identity=0.0, ", "", "identity = nan"),
    ("low=0.0, high=10.0", "low=10.0, high=0.0", "parameter size has no range"),
    ("Bias: the", "Bias of the", 'does not begin with "Name: what it does."'),
    ("PARAMETERS = {", "PARAMETERS = {} if True else {", "PARAMETERS is empty"),
    (
        ADDED,
        "    if p.size > 0.0:\n        setup.add_valve(sys.modules[__name__], {'size': p.size})\n"
        + STAGE,
        (
            "brings a valve stage that maps on S = 0, but MV follows a reversal of OP only after 4"
            " % of travel"
        ),
    ),
]


QUICK = ("stiction", "slew_limit", "valve_lag", "extra_lag", "noise")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)
        for name in PLUGINS.names()
    ],
)
def test_every_effect_keeps_its_contract(name):
    contract = EFFECT_RULES.check(name)
    assert (contract.broken, contract.notes) == ((), ())


def test_a_strangers_effect_keeps_it_and_is_told_that_nobody_recognises_it(contract_of):
    contract = contract_of(BIAS)
    assert (contract.kind, contract.broken) == ("effect", ())
    assert contract.notes == (
        "simulated, but not diagnosed: no file under simbench.recognised says how it is recognised",
    )


@pytest.mark.parametrize(("old", "new", "words"), BROKEN)
def test_each_way_of_breaking_it_is_one_sentence(broken_by, old, new, words):
    broken_by(BIAS, old, new, words)


def test_strengths_lead_from_nothing_to_the_ends_of_the_range():
    module = PLUGINS.load("gain_mismatch")
    assert no_strength(module) == {"factor": 1.0}
    factors = [table["factor"] for table in strengths(module)]
    assert min(factors) < 0.06
    assert max(factors) > 19.9
    assert 1.0 not in factors
