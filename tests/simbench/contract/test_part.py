"""The contract of a part of a loop: every built-in keeps it, and each way of breaking it is one
sentence.
"""

from pathlib import Path

import pytest

from simbench.contract import check, check_file, kind_of
from simbench.loop.part_files import FOLDERS

ROOT = Path(__file__).parents[3]
PLANT = (ROOT / "docs/example/my_foptd.py").read_text(encoding="utf-8")
LAW = (ROOT / "simbench/loop/controllers/error_squared.py").read_text(encoding="utf-8")
PLAY = '''"""A play."""
import numpy as np
from simbench.loop.parameters import Number
SOURCE = "a test"
FRICTION = True
PARAMETERS = {"h": Number("% of travel", low=0.0, high=100.0, says="width")}


def start(u0, p):
    return (min(max(u0, 0.0), 100.0),)


def step(u, state, p):
    x = min(max(u, 0.0), 100.0)
    return (max(x - p.h / 2, min(x + p.h / 2, state[0])),)


def mapped_SJ(p):
    return p.h, 0.0
'''
BIAS = '''"""Bias: the transmitter reads too much."""
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
MORE = "    setup.pv_add += p.size"
BROKEN = [
    (PLAY, '"""A play."""\n', "", "does not begin with a sentence"),
    (PLAY, 'says="width"', 'says=""', "parameter h does not say what it is"),
    (PLAY, "low=0.0, high=100.0", "low=5.0, high=5.0", "parameter h has no range: 5 to 5"),
    (PLAY, 'SOURCE = "a test"', 'SOURCE = ""', "SOURCE is empty"),
    (PLAY, "def mapped_SJ", "def mapped", "has friction, but no mapped_SJ(p)"),
    (PLAY, "return p.h, 0.0", "return 0.0, 0.0", "says FRICTION = True and maps on S = 0"),
    (PLAY, "return p.h, 0.0", "return p.h", "two numbers are needed"),
    (PLAY, "state[0])),)", "state[1])),)", "raises"),
    (PLAY, "(max(x - p.h", "(np.nan * max(x - p.h", "finite"),
    (BIAS, MORE, MORE + " * np.random.random()", "is not deterministic"),
    (BIAS, MORE, "    print(p.size)\n" + MORE, "prints"),
    (BIAS, MORE, MORE + " / 0", "raises ZeroDivisionError"),
    (BIAS, MORE, "    setup.pv_add[3:] = np.nan", "finite numbers are needed"),
    (PLANT, ", a, b_old, b_new\n", ", a, b_old\n", "raises"),
]


@pytest.mark.parametrize(
    ("kind", "name"), [(folder.kind, name) for folder in FOLDERS for name in folder.names()]
)
def test_every_part_keeps_its_contract(kind, name):
    contract = check(kind, name)
    assert (contract.broken, contract.notes) == ((), ())


def test_a_strangers_parts_keep_it(contract_of):
    for kind, text in (("valve", PLAY), ("effect", BIAS), ("plant", PLANT), ("controller", LAW)):
        contract = contract_of(text)
        assert (contract.kind, contract.broken) == (kind, ())
        assert (contract.notes != ()) == (kind == "effect")  # nothing recognises it


def test_the_example_is_a_plant():
    path = ROOT / "docs/example/my_foptd.py"
    assert kind_of(path) == "plant"
    assert check_file(path).kept


@pytest.mark.parametrize(("text", "old", "new", "words"), BROKEN)
def test_each_way_of_breaking_it_is_one_sentence(broken_by, text, old, new, words):
    broken_by(text, old, new, words)
