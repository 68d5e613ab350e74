"""Plants and controllers of others: their contract, their process, and that a FOPTD by hand is
FOPTD.
"""

from pathlib import Path

import numpy as np
import pytest

from simbench.contract import check_file, kind_of
from simbench.loop.hosted import hosted_parts, simulated
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

ROOT = Path(__file__).parents[3]
FOPTD = ROOT / "docs" / "example" / "my_foptd.py"
PLANT = FOPTD.read_text(encoding="utf-8")
LAW = (ROOT / "simbench/loop/controllers/error_squared.py").read_text(encoding="utf-8")
TABLE = {
    "plant": {"type": "foptd", "K": 1.5, "T": 10, "Td": 2.3},
    "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "sampling": {"Ts": 1, "n": 500},
    "noise": {"std": 0.1},
    "setpoint": {"steps": [[10, 55]]},
}


def test_the_example_keeps_its_contract_and_has_the_bits_of_foptd():
    assert kind_of(FOPTD) == "plant"
    assert check_file(FOPTD).broken == ()
    loop = Loop.from_table({**TABLE, "plant": {**TABLE["plant"], "type": "my_foptd"}})
    with hosted_parts(plants=[FOPTD]):
        there = simulated(loop, 1)
    here = simulate(Loop.from_table(TABLE), 1)
    assert np.array_equal(there.record.pv, here.record.pv)
    assert there.notes == ()


@pytest.mark.slow
def test_a_plant_that_numba_cannot_compile_runs_and_says_so(tmp_path):
    slow = tmp_path / "slow_plant.py"
    odd = "    import json\n    x, a, b_old, b_new = json.loads(json.dumps(state))\n"
    slow.write_text(PLANT.replace("    x, a, b_old, b_new = state\n", odd))
    contract = check_file(slow)
    assert contract.broken == ()
    assert "plain Python" in contract.notes[0]
    loop = Loop.from_table({**TABLE, "plant": {**TABLE["plant"], "type": "slow_plant"}})
    with hosted_parts(plants=[slow]):
        run = simulated(loop, 1)
    assert np.array_equal(run.record.pv, simulate(Loop.from_table(TABLE), 1).record.pv)
    assert "slow_plant" in run.notes[0]


BROKEN = [
    (PLANT, "return a * x +", "return 1e-3 + a * x +", "does not stay at rest"),
    (
        PLANT,
        "return a * x + (b_old * w_old + b_new * w_new)",
        "return a * x",
        "does not answer",
    ),
    (PLANT, "return [p.K], [p.T, 1.0]", "return [p.K], [2.0 * p.T, 1.0]", "differs from it"),
    (PLANT, 'SOURCE = "definition: K e^(-Td s)/(T s + 1)"', 'SOURCE = ""', "SOURCE"),
    (
        PLANT,
        '    "K": Number',
        '    "Td": Number("s", says="late"),\n    "K": Number',
        "parameter Td",
    ),
    (PLANT, ", a, b_old, b_new\n", ", a, b_old\n", "one length"),
    (LAW, "INTEGRAL = True", "INTEGRAL = False", "moves on"),
    (LAW, "return min(max(u, p.lo), p.hi), e", "return u, e", "leaves its limits"),
    (LAW, "u = state[0] + gain", "u = state[0] + 0.1 + gain", "does not stay at rest"),
]


@pytest.mark.parametrize(
    ("text", "old", "new", "words"),
    [
        pytest.param(*row, marks=pytest.mark.slow if i in (2, 6, 8) else ())
        for i, row in enumerate(BROKEN)
    ],
)
def test_each_way_of_breaking_it_is_one_sentence(broken_by, text, old, new, words):
    broken_by(text, old, new, words)
