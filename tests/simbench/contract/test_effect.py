"""An effect's contract: every built-in keeps it, and each way of breaking it is caught."""

from dataclasses import replace

import pytest

from simbench.contract.effect import check_effect, no_strength, strengths
from simbench.contract.recogniser import check_recogniser
from simbench.gap.effects import PLUGINS as RECOGNISERS
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
def test_every_effect_and_its_recogniser_keep_their_contract(name):
    contract = check_effect(name)
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


RECOGNISED = '''"""Bias recognised: as noise is."""
from simbench.gap.effects import Recogniser
from simbench.gap.effects.noise import RECOGNISER as NOISE
from dataclasses import replace

RECOGNISER = NOISE
'''
UNRECOGNISED = [
    ("RECOGNISER = NOISE", "RECOGNISER = None", "a simbench.gap.effects.Recogniser is needed"),
    ("= NOISE\n", "= replace(NOISE, needs='valve')\n", "needs = 'valve', allowed"),
    ("= NOISE\n", "= replace(NOISE, replaces='tau')\n", "replaces = 'tau', allowed"),
    ("= NOISE\n", "= replace(NOISE, proven=lambda s: {'std': 1.0})\n", "in a record that has none"),
    ("= NOISE\n", "= replace(NOISE, proven=lambda s: s.nothing)\n", "raises AttributeError"),
    (
        "= NOISE\n",
        "= replace(NOISE, fit=lambda engine, base: base)\n",
        "(Fit, count of numbers it pays for) is needed",
    ),
    (
        "= NOISE\n",
        "= replace(NOISE, fit=lambda engine, base: 1 / 0)\n",
        "raises ZeroDivisionError (division by zero), in fit",
    ),
    (
        "= NOISE\n",
        "= replace(NOISE, fit=lambda e, b: (replace(b, loglik=b.loglik - 5.0), 1.0))\n",
        "fits 5 nats worse than no effect",
    ),
    (
        "= NOISE\n",
        "= replace(NOISE, fit=lambda e, b: (NOISE.fit(e, b)[0], -1.0))\n",
        "pays for -1.0 numbers",
    ),
    ("= NOISE\n", "= Recogniser(fit=NOISE.fit)\n", "has a fit, but its numbers are {}"),
    ("= NOISE\n", "= replace(NOISE, numbers=lambda fit, s: 1 / 0)\n", "in numbers"),
]


def test_a_recogniser_of_its_own_is_checked_and_told_that_its_effect_is_unknown(contract_of):
    contract = contract_of(RECOGNISED, "bias.py")
    assert (contract.kind, contract.broken) == ("recogniser", ())
    assert contract.notes == (
        "no effect 'bias' is known, so its numbers were held against no range",
    )


@pytest.mark.parametrize(("old", "new", "words"), UNRECOGNISED)
def test_each_way_of_breaking_a_recogniser_is_one_sentence(broken_by, old, new, words):
    broken_by(RECOGNISED, old, new, words, "bias.py")


def test_numbers_outside_the_effects_ranges_are_told(monkeypatch):
    noise = RECOGNISERS.load("noise")
    monkeypatch.setattr(
        noise, "RECOGNISER", replace(noise.RECOGNISER, numbers=lambda fit, s: {"factor": -1.0})
    )
    assert (
        "gives numbers that the effect refuses: effect 'noise': factor = -1"
        in check_recogniser("noise").broken[0]
    )
    assert check_effect("noise").broken[0].startswith("its recogniser gives numbers")
