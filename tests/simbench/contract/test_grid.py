"""A grid's contract: every built-in keeps it, and what would stop a run is reported
beforehand.
"""

from pathlib import Path

import pytest

import simbench.scenarios as scenarios
from simbench.contract.grid import check_grid
from simbench.scenarios.grid import load_grid

# a grid whose loops stand in a table alone draws none
GRIDS = [
    path
    for path in sorted((Path(scenarios.__file__).parent / "grids").glob("*.toml"))
    if not load_grid(path.stem).frozen
]
PLAIN = """
title = "one loop"
expected = 4
[loop]
plant = { type = "foptd", K = 1, T = 10, Td = 2 }
controller = { type = "PI", Kc = 1, Ti = 10 }
valve = { model = "choudhury", S = 5, J = 2 }
sampling = { Ts = 1, n = 500 }
[axes]
"valve.J" = [1, 2]
"plant.Td" = [1, 2]
"""
RULED = """
title = "one block"
[[block]]
name = "b"
axes = { Td_over_T = [0.2, 1.0], S_over_2J = [0.5] }
draw = { K = [0.5, 2], T = [5, 50], S = 5, samples_per_period = 40, periods = 20 }
[[block.member]]
name = "sticky"
valve = "choudhury"
[[block.member]]
name = "healthy"
valve = "ideal"
"""
BROKEN = [
    (PLAIN, '"valve.J" = [1, 2]', '"valve.J" = [1, 1]', "axis 'valve.J' has the value 1 twice"),
    (PLAIN, "expected = 4", "expected = 5", "4 scenarios, but expected = 5"),
    (PLAIN, "Ts = 1", "Tx = 1", "key 'sampling.Ts' is missing"),
    (PLAIN, "choudhury", "chudhury", "did you mean 'choudhury'"),
    (PLAIN, "S = 5,", "S = 500,", "S = 500 is out of range"),
    (PLAIN, 'title = "one loop"', 'title = ""', "title is empty"),
    (PLAIN, '"valve.J" = [1, 2]', '"valve.J" = []', "axis 'valve.J' has no value"),
    (
        RULED,
        'name = "healthy"\nvalve = "ideal"',
        'name = "sticky"\nvalve = "choudhury"',
        "is the same scenario as",
    ),
    (RULED, 'valve = "choudhury"', 'valve = "chudhury"', "valve 'chudhury' is unknown"),
    (RULED, "T = [5, 50], ", "", "T"),
]


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            path, id=path.stem, marks=() if path.stem in ("smoke", "ci") else pytest.mark.slow
        )
        for path in GRIDS
    ],
)
def test_every_grid_keeps_its_contract(path):
    assert check_grid(path).broken == ()


@pytest.mark.parametrize("text", [PLAIN, RULED], ids=["plain", "ruled"])
def test_a_strangers_grid_keeps_it(contract_of, text):
    contract = contract_of(text, "mine.toml")
    assert (contract.kind, contract.name, contract.broken) == ("grid", "mine", ())


@pytest.mark.parametrize(("text", "old", "new", "words"), BROKEN)
def test_each_way_of_breaking_it_is_one_sentence(broken_by, text, old, new, words):
    broken_by(text, old, new, words, "mine.toml")


def test_one_mistake_of_many_groups_is_told_once(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(
        "\n".join(
            [
                'title = "own"',
                '[loop.plant]\ntype = "foptd"\nK = 1\nT = 10\nTd = 2',
                '[loop.controller]\ntype = "PI"\nKc = 1\nTi = 10',
                '[loop.valve]\nmodel = "choudury"\nS = 5\nJ = 2',
                "[loop.sampling]\nTs = 1",
                '[axes]\n"valve.S" = [1, 2, 3, 4, 5, 6]\n"valve.J" = [1, 2, 3, 4]',
            ]
        )
    )
    (sentence,) = check_grid(path).broken
    assert "did you mean 'choudhury'" in sentence
