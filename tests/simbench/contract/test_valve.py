"""A valve's contract: every built-in keeps it, and a wrong label or a step that is no step is
caught.
"""

import pytest

from simbench.contract.band import measured_band
from simbench.contract.valve import VALVE_RULES
from simbench.loop.parameters import VALVES, valve_parameters

PLAY = '''"""A play."""
import numpy as np
from simbench.loop.parameters import Number
SOURCE = "a test"
FRICTION = True
PARAMETERS = {"h": Number("% of travel", low=0.0, high=100.0, says="width")}
CALLS = []


def start(u0, p):
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    x = min(max(u, 0.0), 100.0)
    return (max(x - p.h / 2, min(x + p.h / 2, state[0])),)


def mapped_SJ(p):
    return p.h, 0.0
'''
INPUT = "    x = min(max(u, 0.0), 100.0)\n"
BROKEN = [
    (
        "return p.h, 0.0",
        "return 2.0 * p.h, 0.0",
        "maps on S = 8, but MV follows a reversal of OP only after 4 % of travel",
    ),
    (
        "return p.h, 0.0",
        "return 4.0, 0.0",
        "but MV follows a reversal of OP only after 7 % of travel, with h = 7",
    ),
    ("return p.h, 0.0", "return p.h, 2.0", "maps on J = 2, but MV slips by 0 % of travel"),
    ("return p.h, 0.0", "return 0.0, 0.0", "says FRICTION = True and maps on S = 0"),
    ("FRICTION = True", "FRICTION = False", "says FRICTION = False and maps on S = 4"),
    ("def mapped_SJ", "def mapped", "has friction, but no mapped_SJ(p)"),
    ("return p.h, 0.0", "return p.h", "mapped_SJ is 4.0, two numbers (S, J) are needed"),
    ("FRICTION = True", 'FRICTION = "yes"', "FRICTION = 'yes', true or false is needed"),
    ("state[0])),)", "state[0])))", "a tuple of one length throughout is needed"),
    ("state[0])),)", "state[0])), 0.0)", "a tuple of one length throughout is needed"),
    ("return (max(x", "return (1 if x > 50.0 else 0,) if x > 0.0 else (max(x", "floats are needed"),
    (INPUT, "    x = u\n", "leaves its travel"),
    (INPUT, INPUT + "    x = x + 1e-9 * np.random.random()\n", "is not deterministic"),
    (INPUT, INPUT + "    print(x)\n", "prints"),
    (INPUT, "    x = CALLS or min(max(u, 0.0), 100.0)\n", "compiled"),
    (
        "(min(max(u0, 0.0), 100.0),)",
        "(0.5 * min(max(u0, 0.0), 100.0),)",
        "does not stay at rest: MV goes from 18.75 to",
    ),
    ("state[0])),)", "state[1])),)", "raises IndexError"),
    ('says="width"', 'says=""', "parameter h does not say what it is"),
    ("low=0.0, high=100.0", "low=5.0, high=5.0", "parameter h has no range: 5 to 5"),
    ('"""A play."""\n', "", "does not begin with a sentence"),
]


@pytest.mark.parametrize("name", VALVES.names())
def test_every_valve_keeps_its_contract_and_its_label_is_measured(name):
    assert VALVE_RULES.check(name).broken == ()


def test_a_strangers_play_keeps_it(contract_of):
    contract = contract_of(PLAY)
    assert (contract.kind, contract.name, contract.broken) == ("valve", "mine", ())


@pytest.mark.parametrize(("old", "new", "words"), BROKEN)
def test_each_way_of_breaking_it_is_one_sentence(broken_by, old, new, words):
    broken_by(PLAY, old, new, words)


@pytest.mark.parametrize(("S", "J"), [(2.0, 2.0), (6.0, 3.0), (12.0, 1.0), (3.0, 5.0)])
@pytest.mark.parametrize("model", ["choudhury", "kano", "he"])
def test_the_band_measured_is_the_band_that_was_set(model, S, J):
    module = VALVES.load(model)
    if model == "he" and J > S:
        pytest.skip("fd < 0: every slip overshoots")
    band = measured_band([(module, valve_parameters(module, {"S": S, "J": J}, 1.0))], 20.0)
    assert band == pytest.approx((S, J), rel=0.06, abs=0.05)
