"""Grids nobody should run: refused before the first simulation, all mistakes at once; what fails
later is a row.
"""

from __future__ import annotations

import json
from itertools import product

import pyarrow.parquet as pq
import pytest

from simbench.bench.execute import compute_piece as piece
from simbench.bench.execute.failures import read_failures
from tests.simbench.boundary.conftest import (
    answer_to,
    names_in,
    new_tokens,
    refused,
    run_verb,
    sampled,
)

HEAD = """
title = "a grid"
source = "own"
seed = 1
repeats = 1
[draw]
K = [0.5, 2.0]
T = [2.0, 500.0]
S = [1.5, 8.0]
speed = [0.8, 1.25]
step = [0.6, 1.2]
excitation = ["setpoint", "load"]
samples_per_period = [20.0, 30.0]
periods = [15.0, 16.0]
[disturbances.sine]
type = "sine"
at = "output"
amplitude = [0.7, 2.0]
period = [0.4, 2.5]
[disturbances.sine.parameters]
phase = 1.0
[valves.lag]
parameters = { T = [0.01, 0.05] }
scale = { T = "period" }
[effects.noise]
parameters = { std = [0.1, 0.2] }
[[block]]
name = "one"
process = "foptd"
controller = "PI"
draw = { mv_noise = 0.01 }
[block.axes]
Td_over_T = [0.3, 1.0]
S_over_2J = [0.5]
noise_ratio = [0.1]
disturbance = ["none", "sine"]
[[block.member]]
name = "sticky"
valve = "choudhury"
[[block.member]]
name = "healthy"
valve = "ideal"
tuning = ["same", "aggressive"]
where = { disturbance = ["none"] }
"""
PLAIN = """
title = "a loop"
axes = { "valve.S" = [2.0, 4.0] }
[loop.plant]
type = "foptd"
K = 1.0
T = 10.0
Td = 2.0
[loop.controller]
type = "PI"
Kc = 1.0
Ti = 10.0
[loop.valve]
model = "choudhury"
S = 5.0
J = 2.0
[loop.sampling]
Ts = 1.0
n = 300
"""
RANGED = HEAD[: HEAD.index("[[block]]")].splitlines()
RANGES = [
    line
    for line in RANGED
    if line.endswith("]") and " = [" in line and line[0] in "KTSspa" and '"' not in line
]
BAD_RANGES = [
    "[2.0, 1.0]",
    "[0.0, 1.0]",
    "[-1.0, 1.0]",
    "[nan, 1.0]",
    "[1.0, inf]",
    "[]",
    "[1.0]",
    "[1.0, 2.0, 3.0]",
    '["a", 2.0]',
    "nan",
    "true",
    '"fast"',
    "{}",
    "[true, 2.0]",
    "2024-01-01",
]
CHANGES = {
    "unknown load type": ('type = "sine"', 'type = "sinus"', "sine"),
    "unknown load place": ('at = "output"', 'at = "outlet"', "output"),
    "unknown load parameter": ("phase = 1.0", "fase = 1.0", "phase"),
    "word for a phase": ("phase = 1.0", 'phase = "none"', "phase"),
    "unknown disturbance": (
        'disturbance = ["none", "sine"]',
        'disturbance = ["none", "sinus"]',
        "sine",
    ),
    "number as disturbance": (
        'disturbance = ["none", "sine"]',
        'disturbance = ["none", 3]',
        "words",
    ),
    "unknown valve": ('valve = "choudhury"', 'valve = "choudury"', "choudhury"),
    "no valve": ('valve = "choudhury"', "valve = []", "valve"),
    "a number as valve": ('valve = "choudhury"', "valve = 3", "valve"),
    "unknown valve table": ("[valves.lag]", "[valves.leg]", "lag"),
    "unknown valve parameter": (
        "{ T = [0.01, 0.05] }\nscale = { T",
        "{ Z = [0.01, 0.05] }\nscale = { Z",
        "Z",
    ),
    "unknown scale": ('scale = { T = "period" }', 'scale = { T = "hour" }', "period"),
    "scale of nothing": ('scale = { T = "period" }', 'scale = { D = "period" }', "scale"),
    "unknown effect": ("[effects.noise]", "[effects.noize]", "noise"),
    "unknown effect parameter": ("{ std = [0.1, 0.2] }", "{ sdt = [0.1, 0.2] }", "std"),
    "negative effect": ("{ std = [0.1, 0.2] }", "{ std = -1.0 }", "std"),
    "unknown tuning": (
        'tuning = ["same", "aggressive"]',
        'tuning = ["same", "agressive"]',
        "aggressive",
    ),
    "where of no axis": ("where = { disturbance", "where = { tuning", "where"),
    "where of nothing": (
        'where = { disturbance = ["none"] }',
        "where = { disturbance = [] }",
        "disturbance",
    ),
    "where of unknown": (
        'where = { disturbance = ["none"] }',
        'where = { disturbance = ["nun"] }',
        "none",
    ),
    "unknown process": ('process = "foptd"', 'process = "foptdd"', "foptd"),
    "unknown controller": ('controller = "PI"', 'controller = "PID"', "PI"),
    "unknown excitation": (
        'excitation = ["setpoint", "load"]',
        'excitation = ["setpint"]',
        "setpoint",
    ),
    "empty axis": ("Td_over_T = [0.3, 1.0]", "Td_over_T = []", "Td_over_T"),
    "axis of words": ("Td_over_T = [0.3, 1.0]", 'Td_over_T = ["a"]', "Td_over_T"),
    "axis with nan": ("Td_over_T = [0.3, 1.0]", "Td_over_T = [nan]", "Td_over_T"),
    "axis below zero": ("Td_over_T = [0.3, 1.0]", "Td_over_T = [-0.3]", "Td_over_T"),
    "axis of tables": ("Td_over_T = [0.3, 1.0]", "Td_over_T = [{}]", "Td_over_T"),
    "axis of lists": ("Td_over_T = [0.3, 1.0]", "Td_over_T = [[1.0]]", "Td_over_T"),
    "axis of truths": ("Td_over_T = [0.3, 1.0]", "Td_over_T = [true]", "Td_over_T"),
    "value twice": ("Td_over_T = [0.3, 1.0]", "Td_over_T = [0.3, 0.3]", "twice"),
    "number for an axis": ("Td_over_T = [0.3, 1.0]", "Td_over_T = 0.3", "Td_over_T"),
    "unknown axis": ("Td_over_T = [0.3, 1.0]", "Td_over_TT = [0.3, 1.0]", "Td_over_T"),
    "no stick band": ("S_over_2J = [0.5]", "S_over_2J = [0.0]", "S_over_2J"),
    "noise below zero": ("noise_ratio = [0.1]", "noise_ratio = [-0.1]", "noise_ratio"),
    "unknown key": ('source = "own"', 'sauce = "own"', "source"),
    "seed as fraction": ("seed = 1", "seed = 1.5", "seed"),
    "seed below zero": ("seed = 1", "seed = -1", "seed"),
    "seed as word": ("seed = 1", 'seed = "1"', "seed"),
    "seed too large": ("seed = 1", "seed = 99999999999999999999999", "seed"),
    "no repeats": ("repeats = 1", "repeats = 0", "repeats"),
    "too many repeats": ("repeats = 1", "repeats = 1000000000000", "repeats"),
    "many repeats": ("repeats = 1", "repeats = 900000", "--n 10000"),
    "no blocks": (HEAD[HEAD.index("[[block]]") :], "", "block"),
    "no members": (HEAD[HEAD.index("[[block.member]]") :], "", "member"),
    "title as number": ('title = "a grid"', "title = 3", "title"),
    "expected": ('title = "a grid"', 'title = "a grid"\nexpected = 7', "expected"),
    "both forms": ('title = "a grid"', 'title = "a grid"\nloop = {}', "either"),
    "mv noise as word": ("mv_noise = 0.01", 'mv_noise = "a"', "mv_noise"),
    "draw of unknown": ("mv_noise = 0.01", "mv_nois = 0.01", "mv_noise"),
    "records too long": ("periods = [15.0, 16.0]", "periods = [1e6, 1e7]", "periods"),
    "S over travel": ("S = [1.5, 8.0]", "S = [1.5, 800.0]", "S"),
    "not needed": ("periods = [15.0, 16.0]", "", "periods"),
    "missing K": ("K = [0.5, 2.0]", "", "K"),
    "a digit too many": ("seed = 1", f"seed = {'1' * 5000}", "digits"),
    "deep": ("seed = 1", f"seed = {'[' * 3000}{']' * 3000}", "nested"),
}
PLAIN_CHANGES = {
    "unknown key": ('"valve.S"', '"valve.R"', "R"),
    "no section": ('"valve.S"', '"vlave.S"', "valve"),
    "no dot": ('"valve.S"', '"S"', "section.name"),
    "empty": ("[2.0, 4.0]", "[]", "valve.S"),
    "word": ("[2.0, 4.0]", '["a", 4.0]', "S"),
    "nan": ("[2.0, 4.0]", "[2.0, nan]", "nan"),
    "below": ("[2.0, 4.0]", "[2.0, -4.0]", "S"),
    "plant": ("K = 1.0", "K = -1.0", "positive feedback"),
    "n": ("n = 300", "n = 2", "n"),
    "huge axis": ("[2.0, 4.0]", "[2.0, 1e300]", "S"),
}


RUN = "run grid.toml -o run --method horch"


def put(text: str) -> None:
    """Write a grid."""
    with open("grid.toml", "w") as file:
        file.write(text)


def refuse(folder, old: str, new: str, part: str, base: str = HEAD) -> None:
    """Have a grid with one change refused, with nothing written."""
    assert old in base
    put(base.replace(old, new, 1))
    values = [v for v in new_tokens(old, new) if len(v) < 1000 and part != "--n 10000"]
    refused(RUN, "grid", part, values=values[:1])
    assert names_in(folder) == ["grid.toml"]


@pytest.mark.parametrize("name", sampled(CHANGES, 4))
def test_a_wrong_grid(here, name):
    refuse(here, *CHANGES[name])


@pytest.mark.parametrize(("line", "bad"), sampled(product(RANGES, BAD_RANGES), 16))
def test_a_range_that_is_none(here, line, bad):
    key = line.split(" ")[0]
    put(HEAD.replace(line, f"{key} = {bad}", 1))
    refused(RUN, "grid", key, values=new_tokens("", bad)[:1])
    assert names_in(here) == ["grid.toml"]


@pytest.mark.parametrize("name", sampled(PLAIN_CHANGES, 3))
def test_a_wrong_grid_of_one_loop(here, name):
    refuse(here, *PLAIN_CHANGES[name], base=PLAIN)


OPTIONS = [
    ("--set repeats=0", "repeats"),
    ("--set seed=x", "seed"),
    ("--set colour=1", "colour"),
    ("--set K", "NAME=VALUE"),
    ("--set =1", "NAME=VALUE"),
    ("--set K=fast", "K"),
    ("--set K=nan", "K"),
    ("--set repeats=nan", "repeats"),
    ("--set repeats=1e300", "repeats"),
    ("--set seed=1.5", "seed"),
    ("--set plant.Q=1", "Q"),
    ("--set plant.=1", "plant"),
    ("--set controller.Kc=-1", "Kc"),
    ("--axis Td_over_T=", "Td_over_T"),
    ("--axis Td_over_T=a,b", "Td_over_T"),
    ("--axis x=1", "x"),
    ("--axis Td_over_T=1,1", "twice"),
    ("--axis disturbance=sinus", "sine"),
    ("--n 0", "--n"),
    ("--n 1e3", "--n"),
    ("-j 0", "-j"),
    ("-j 100000", "-j"),
    ("-j -7", "-j"),
    ("--backend spark", "dask"),
    ("--backend dask", "address"),
    ("--method ", "empty"),
    ("--method ,", "detector"),
    ("--method horhc", "horch"),
    ("--seed 1", "--seed"),
    ("--allow-failed 2", "allow-failed"),
    ("--backend dask --address nowhere", "nowhere"),
]


@pytest.mark.parametrize(("option", "part"), sampled(OPTIONS, 4))
def test_a_wrong_option_of_run(here, option, part):
    key, _, value = option.rpartition(" ")[2].rpartition("=")
    put(HEAD)
    # where the key itself is wrong, it is what the sentence quotes
    values = [key if key and key.strip(".") == part else value.split(",")[0]]
    words = [*RUN.split(), *option.split(" ")]  # an empty value is a word too
    refused(words, part, values=values)
    assert names_in(here) == ["grid.toml"]


def test_what_cannot_be_simulated_is_a_row_with_its_reason_and_the_exit_code_says_so(
    here, monkeypatch
):
    """A valve that refuses one of four cells: three are judged, one is reported."""
    whole = piece.simulate_with_truth

    def fails_once(loop, seed):
        dead = loop.plant.Td / loop.plant.T > 0.9
        if dead and loop.valve.name == "choudhury" and not loop.disturbance[1:]:
            raise FloatingPointError("the loop ran away")
        return whole(loop, seed)

    monkeypatch.setattr(piece, "simulate_with_truth", fails_once)
    put(HEAD)
    code, answer, message = run_verb(f"{RUN} --json")
    assert code == 1
    failed = json.loads(answer)["failed"]
    assert 0 < failed["scenarios"] < failed["of"]
    assert "the loop ran away" in message
    rows = pq.read_table(here / "run" / "scenarios.parquet", columns=["error"]).column(0)
    assert rows.length() - rows.null_count == failed["scenarios"]
    code, _, message = run_verb("score run")
    assert code == 1
    assert "could not be simulated" in message
    answer_to("score run --allow-failed 0.9")
    failures = read_failures(here / "run")
    assert failures.above(0.0)
    assert not failures.above(0.9)
