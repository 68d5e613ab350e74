"""The mill's records: pure, complete, as visible as they say, and told apart by nothing but the
effect itself.
"""

from __future__ import annotations

import ast
import json
from copy import deepcopy
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import results.studies.worlds.mill as mill
from detectors.errors import ParameterError, UnknownName
from results.studies.worlds.mill.drawing import ALIKE, sound
from results.studies.worlds.mill.loops import baseline, draw_loop
from results.studies.worlds.mill.oracle import BANDS, cloud, ratio, strength_of
from results.studies.worlds.mill.statistics import floors, measure, names
from scenarios.spec import Loop
from simbench.blind.world import WORLD_EFFECTS
from simbench.loop.effects import BLOCKS, Choice

KEYS = {
    "kind",
    "block",
    "effect",
    "effect2",
    "block2",
    "strength",
    "ratio",
    "parameters",
    "parameters2",
    "foreign",
    "mv",
    "plant",
    "controller",
    "sp_moves",
    "case",
    "seed",
}
SEED = 404
ENTRIES = [
    *(
        {"kind": "single", "effect": e, "strength": list(BANDS)[i % 3], "mv": i % 2 == 0}
        for i, e in enumerate(WORLD_EFFECTS)
    ),
    *(
        {"kind": "foreign", "effect": f, "strength": list(BANDS)[i % 3], "mv": i % 2 == 1}
        for i, f in enumerate(mill.FOREIGN)
    ),
    {"kind": "two", "mv": True},
    {"kind": "two", "mv": False},
    {"kind": "none", "mv": True},
    {"kind": "none", "mv": False},
]


@cache
def drawn(number):
    return mill.draw(SEED, number, ENTRIES[number])


def truth(answer):
    one = {"effect": answer["foreign"] or answer["effect"], "parameters": answer["parameters"]}
    two = {"effect": answer["effect2"], "parameters": answer["parameters2"]}
    return [e for e in (one, two) if e["effect"] not in ("", "none")]


def within_vocabulary(effect, parameters):
    rules = WORLD_EFFECTS[effect].parameters
    assert set(parameters) == set(rules)
    for key, value in parameters.items():
        rule = rules[key]
        assert value in rule.names if isinstance(rule, Choice) else rule.low <= value <= rule.high


@pytest.mark.parametrize(
    "number", range(len(ENTRIES)), ids=[f"{e['kind']}-{e.get('effect', '')}" for e in ENTRIES]
)
def test_every_entry_gives_a_whole_item(number):
    entry, (columns, table, answer) = ENTRIES[number], drawn(number)
    json.dumps(answer, allow_nan=False)
    assert set(answer) == KEYS
    assert set(columns) == {"t", "sp", "op", "pv"} | ({"mv"} if entry["mv"] else set())
    n = answer["case"]["n"]
    assert 800 <= n <= 5000
    assert all(c.shape == (n,) and np.all(np.isfinite(c)) for c in columns.values())
    assert np.allclose(np.diff(columns["t"]), table["sampling"]["Ts"])
    loop = Loop.from_table(table)
    assert (loop.plant.type, loop.controller.type) == (answer["plant"], answer["controller"])
    assert answer["sp_moves"] == (np.ptp(columns["sp"]) > 0.0)
    given = answer["parameters2"] | answer["parameters"]
    assert sound(answer["case"], columns, (given.get("lo", 0.0), given.get("hi", 100.0)))
    if entry["kind"] == "none":
        assert (answer["effect"], answer["block"], answer["parameters"], answer["ratio"]) == (
            "none",
            "none",
            {},
            1.0,
        )
    elif entry["kind"] == "foreign":
        assert (answer["effect"], answer["foreign"]) == ("unknown", entry["effect"])
        assert answer["block"] == mill.FOREIGN[entry["effect"]]
    else:
        for effect, block, parameters in (
            ("effect", "block", "parameters"),
            ("effect2", "block2", "parameters2"),
        ):
            if answer[effect]:
                assert answer[block] == WORLD_EFFECTS[answer[effect]].block
                within_vocabulary(answer[effect], answer[parameters])
    if "strength" in entry:
        assert answer["strength"] == entry["strength"] == strength_of(answer["ratio"])
    if entry["kind"] == "two":
        assert answer["block"] != answer["block2"] != ""
        assert answer["ratio"] >= 2.0
        assert not any(answer["effect"] in row and answer["effect2"] in row for row in ALIKE)


@pytest.mark.parametrize("number", range(0, len(ENTRIES), 6))
def test_truth_and_seed_give_the_record_again_bit_for_bit(number):
    columns, _, answer = drawn(number)
    again = mill.simulate(json.loads(json.dumps(answer)), truth(answer), answer["seed"])
    assert set(again) == set(columns)
    assert all(np.array_equal(again[k], columns[k]) for k in columns)


def test_draws_are_pure_in_any_order():
    numbers = [3, 20, len(ENTRIES) - 1]
    first = [drawn(i) for i in numbers]
    for i, before in reversed(list(zip(numbers, first))):
        after = mill.draw(SEED, i, ENTRIES[i])
        assert after.answer == before.answer
        assert after.baseline == before.baseline
        assert all(np.array_equal(after.columns[k], before.columns[k]) for k in before.columns)


def test_another_seed_is_another_run_of_the_same_loop():
    _, _, answer = drawn(len(ENTRIES) - 1)
    one, two = mill.simulate(answer, [], 1), mill.simulate(answer, [], 2)
    assert np.array_equal(one["sp"], two["sp"])
    assert not np.array_equal(one["pv"], two["pv"])
    other = deepcopy(answer)
    other["case"]["nominal"]["K"] *= 1.1
    assert not np.array_equal(one["pv"], mill.simulate(other, [], 1, nominal=True)["pv"])
    assert np.array_equal(one["pv"], mill.simulate(other, [], 1)["pv"])


@pytest.mark.parametrize(
    "number", [i for i, e in enumerate(ENTRIES) if e.get("strength") in ("medium", "strong")][::3]
)
def test_visibility_is_found_again_under_fresh_seeds(number):
    _, _, answer = drawn(number)
    healthy = cloud(answer["case"], [], list(range(900, 924)))
    value, _ = ratio(answer["case"], truth(answer), list(range(800, 808)), healthy)
    low, high = BANDS[answer["strength"]]
    assert 0.7 * low <= value <= 1.4 * high


def test_nothing_is_not_visible():
    for number in range(6):
        case = draw_loop(np.random.default_rng(number))
        value, _ = ratio(case, [], [1, 2, 3, 4, 5], cloud(case, [], list(range(10, 30))))
        assert 0.6 < value < 1.4


def test_the_loop_comes_from_seed_and_index_and_not_from_the_effect():
    """No leak by construction: whatever is drawn into a loop, its baseline, length and set point
    were there before.

    A known dead-band belongs to records without a valve effect, as the order says; other loops are
    replaced only where they cannot hold the effect at the visibility asked for.
    """
    same = []
    for number in range(len(ENTRIES)):
        table, answer = drawn(number)[1:]
        first = draw_loop(
            np.random.default_rng([SEED, number, 0]),
            "foptd" if "time_const" in answer["effect"] else None,
        )
        there = baseline(first)
        if answer["block"] == "valve" or answer["block2"] == "valve":
            there["valve"] = {"model": "ideal"}
        same.append(there == table and first["setpoint"] == answer["case"]["setpoint"])
    assert np.mean(same) > 0.6


def test_wishes_are_heard_and_nonsense_is_refused():
    for plant in ("foptd", "integrating"):
        assert mill.draw(1, 1, {"kind": "none", "plant": plant}).answer["plant"] == plant
    for entry, word in (
        ({"kind": "triple"}, "triple"),
        ({"kind": "single", "effect": "stroke_speed", "strength": "weak"}, "stroke_speed"),
        ({"kind": "foreign", "effect": "stiction", "strength": "weak"}, "stiction"),
        ({"kind": "single", "effect": "stiction", "strength": "huge"}, "huge"),
        ({"kind": "none", "plant": "second"}, "second"),
    ):
        with pytest.raises(UnknownName, match=word):
            mill.draw(1, 1, entry)
    impossible = {
        "kind": "single",
        "effect": "time_constant_mismatch",
        "strength": "weak",
        "plant": "integrating",
    }
    with pytest.raises(ParameterError, match="foptd"):
        mill.draw(1, 1, impossible)


def test_drawn_loops_keep_to_the_ranges_of_the_order():
    cases = [draw_loop(np.random.default_rng([8, i])) for i in range(80)]
    share = np.mean([c["plant"]["type"] == "integrating" for c in cases])
    assert 0.17 < share < 0.5
    assert 0.04 < np.mean([c["controller"]["product"] == "bias_p" for c in cases]) < 0.28
    assert 0.35 < np.mean([c["setpoint"]["kind"] == "constant" for c in cases]) < 0.65
    assert {c["plant"]["K"] > 0 for c in cases} == {True, False}
    for c in cases:
        T = c["plant"].get("T")
        if T is not None:
            assert 3.0 <= T / c["Ts"] <= 40.0
            assert 0.045 <= c["plant"]["Td"] / T <= 1.51
        assert c["transmitter"]["count"] <= c["noise"]["std"] / 5.0
        assert 0.19 <= c["known_band"] <= 1.0 or c["known_band"] == 0.0
        assert 0.0003 * c["span"] * 0.28 <= c["noise"]["std"] <= 0.5 * 0.031 * c["span"]
        nominal = c["nominal"]
        assert abs(nominal["K"] / c["plant"]["K"] - 1.0) <= 0.101
        Loop.from_table(baseline(c))


def test_foreign_kinds_are_many_and_strange():
    assert len(mill.FOREIGN) >= 8
    assert len(set(mill.FOREIGN.values())) >= 4
    assert set(mill.FOREIGN.values()) <= set(BLOCKS)
    assert not set(mill.FOREIGN) & set(WORLD_EFFECTS)


def test_statistics_are_phase_free_and_free_of_units_but_for_sizes():
    rng = np.random.default_rng(0)
    op, pv = 50.0 + np.cumsum(rng.standard_normal(2000)) * 0.1, rng.standard_normal(2000)
    record = {"sp": np.full(2000, 1.0), "op": op, "pv": pv}
    x = measure(record, 1.0, 0)
    assert x.shape == floors().shape == (len(names()),)
    assert np.all(np.isfinite(x))
    scaled = measure({"sp": 7.0 * record["sp"] + 3.0, "op": op, "pv": 7.0 * pv + 3.0}, 1.0 / 7.0, 0)
    moved = np.abs(scaled - x) > 1e-6
    units = [
        n.startswith(("power error", "size", "slow of error", "surprise")) and "op" not in n
        for n in names()
    ]
    assert np.array_equal(moved, units)


def test_the_world_imports_nothing_that_it_judges():
    words = (
        "simbench.blind.world",
        "simbench.blind.menu",
        "simbench.loop.effects",
        "scenarios.spec",
        "detectors.errors",
    )
    allowed = ("results.studies.worlds.mill", *words)
    for path in Path(mill.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            ours = [m for m in modules if m.split(".")[0] in ("simbench", "scenarios", "detectors")]
            assert all(m.startswith(allowed) for m in ours), f"{path.name}: {ours}"
