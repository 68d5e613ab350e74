"""A world's contract: the three of the project and the tutorial's keep it, and each broken point
is a sentence.
"""

import re
from pathlib import Path

import pytest

import simbench
from results.studies.worlds import NAMES
from simbench.contract.world import check_world

TUTORIAL = Path(simbench.__file__).parents[1] / "docs" / "site" / "tutorials" / "own_world.md"
TANK = re.search(
    r"%%writefile tank\.py\n(.*?)```", TUTORIAL.read_text(encoding="utf-8"), re.DOTALL
)[1]
PAIR = '["noise", "gain_mismatch"] if entry["kind"] == "two"'
BROKEN = [
    ('TITLE = "tank: one first-order plant under PI"', 'TITLE = ""', "TITLE is empty"),
    ('FOREIGN = {"tripping_pump": "disturbance"}', "FOREIGN = {}", "FOREIGN is no dict of faults"),
    (
        '"tripping_pump": "disturbance"',
        '"tripping_pump": "pump"',
        "of block 'pump', allowed: controller, valve",
    ),
    (
        'FOREIGN = {"tripping_pump"',
        'FOREIGN = {"drift": "sensor", "tripping_pump"',
        "'drift' is an effect of the vocabulary",
    ),
    ('if mv or name != "mv"', 'if name != "sp" and (mv or name != "mv")', "columns lack sp"),
    ('if mv or name != "mv"', "", "mv is recorded, against what was asked for"),
    ("{name: x for", '{name: x[:-1] if name == "op" else x for', "columns are not equally long"),
    (
        "pv[k] = x + noise[k]",
        'pv[k] = x + noise[k] + (float("nan") if k == 7 else 0.0)',
        "numbers that are not finite",
    ),
    ('"Td": 0.0', '"Td": -1.0', "Td"),
    ('"sp_moves": True, ', "", "the answer lacks sp_moves"),
    (
        '"case": {**case, "given": given}',
        '"case": {**case, "given": {1, 2}}',
        "set is not JSON serializable",
    ),
    (
        '"kind": entry["kind"], "str',
        '"kind": "none", "str',
        "the answer says none 'gain_mismatch', asked was single",
    ),
    (
        '{"factor": 2.0}',
        '{"times": 2.0}',
        "parameters of gain_mismatch are ['times'], known: factor",
    ),
    (
        'BLOCKS = {"noise": "sensor"',
        'BLOCKS = {"noise": "valve"',
        "block of noise is 'valve', it is sensor",
    ),
    (
        "np.random.default_rng([seed, index])",
        "np.random.default_rng()",
        "two draws of one seed and index differ",
    ),
    (
        "np.random.default_rng(seed), {e",
        "np.random.default_rng(), {e",
        "simulate: two runs of one seed differ",
    ),
    (
        'given.get("noise", {}).get("factor", 1.0)',
        "1.0",
        "noise thirty times as loud changes nothing",
    ),
    ("1.0 if nominal", "1 / 0 if nominal", "raises ZeroDivisionError"),
    (
        "def draw(seed, index, entry):",
        'def draw(seed, index, entry):\n    raise ParameterError("no")',
        "draws nothing",
    ),
]


def test_the_tutorials_world_keeps_it_and_what_it_does_not_draw_is_a_note(contract_of):
    contract = contract_of(TANK, "tank.py")
    assert (contract.kind, contract.broken, contract.notes) == ("world", (), ())
    assert PAIR in TANK
    few = contract_of(TANK.replace(PAIR, PAIR.replace("noise", "lag", 1)), "tank.py")
    assert few.broken == ()
    assert few.notes[0].startswith("does not draw two: tank: lag is not drawn here")


@pytest.mark.parametrize(("old", "new", "words"), BROKEN)
def test_each_way_of_breaking_it_is_one_sentence(broken_by, old, new, words):
    broken_by(TANK, old, new, words, "tank.py")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_worlds_of_the_project_keep_it(name):
    contract = check_world(name)
    assert (contract.broken, contract.notes) == ((), ())
