"""Every world keeps the contract: pure draws, loadable baselines, answers in the vocabulary's
words, loops that run again.
"""

import ast
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds import NAMES, load_world
from simbench.loop.effects import Choice
from simbench.scenarios.spec import Loop

SEED = 11
STRENGTHS = ("weak", "medium", "strong")
FAST = {"gain_mismatch", "", "frozen_spells", "frozen_sensor", "range_clip"}
KEYS = {
    "kind", "block", "effect", "effect2", "block2", "strength", "ratio", "foreign", "mv", "plant",
    "controller", "sp_moves", "case", "seed",
}  # fmt: skip


def entries(world):
    drawn = [("single", e) for e in WORLD_EFFECTS]
    drawn += [("foreign", e) for e in load_world(world).FOREIGN] + [("two", ""), ("none", "")]
    return [
        {"kind": kind, "effect": e, "strength": STRENGTHS[i % 3], "mv": i % 2 == 0}
        for i, (kind, e) in enumerate(drawn)
    ]


@cache
def item_of(world, number):
    return load_world(world).draw(SEED, number, entries(world)[number])


def hidden_in(answer):
    first = {
        "effect": answer["foreign"] or answer["effect"],
        "parameters": answer.get("parameters"),
    }
    second = {"effect": answer["effect2"], "parameters": answer.get("parameters2")}
    return [e for e in (first, second) if e["effect"] not in ("", "none")]


def same(a, b):
    return set(a) == set(b) and all(np.array_equal(a[k], b[k]) for k in a)


def cases():
    for world in NAMES:
        for number, e in enumerate(entries(world)):
            rare = e["effect"] not in FAST or (world == "refinery" and e["kind"] == "two")
            marks = pytest.mark.slow if rare else ()
            yield pytest.param(world, number, id=f"{world}-{e['kind']}-{e['effect']}", marks=marks)


@pytest.mark.parametrize(("world", "number"), list(cases()))
def test_every_entry_gives_a_whole_item_whose_answer_gives_the_record_again(world, number):
    entry, item = entries(world)[number], item_of(world, number)
    columns, a = item.columns, item.answer
    answer = json.loads(json.dumps(a, allow_nan=False))
    assert set(answer) >= KEYS
    assert set(columns) == {"t", "sp", "op", "pv"} | ({"mv"} if entry["mv"] else set())
    loop = Loop.from_table(item.baseline)
    assert 800 <= loop.sampling.n <= 5000
    assert all(x.shape == (loop.sampling.n,) and np.isfinite(x).all() for x in columns.values())
    assert 0 <= columns["op"].min() < columns["op"].max() <= 100
    np.testing.assert_allclose(np.diff(columns["t"]), loop.sampling.Ts, rtol=1e-3)
    assert (loop.plant.type, loop.controller.type) == (a["plant"], a["controller"])
    assert (a["kind"], a["mv"]) == (entry["kind"], entry["mv"])
    assert a["sp_moves"] == bool(np.ptp(columns["sp"]) > 0)
    if entry["kind"] == "none":
        assert (a["effect"], a["block"]) == ("none", "none")
    elif entry["kind"] == "foreign":
        assert (a["effect"], a["foreign"]) == ("unknown", entry["effect"])
        assert a["block"] == load_world(world).FOREIGN[entry["effect"]]
    for end in ("", "2"):
        effect = a[f"effect{end}"]
        if effect in WORLD_EFFECTS:
            assert a[f"block{end}"] == WORLD_EFFECTS[effect].block
            for name, value in a[f"parameters{end}"].items():
                rule = WORLD_EFFECTS[effect].parameters[name]
                allowed = rule.names if isinstance(rule, Choice) else (value,)
                assert value in allowed
                assert isinstance(rule, Choice) or rule.low <= value <= rule.high
    if entry["kind"] in ("single", "foreign"):
        assert a["strength"] == entry["strength"]
    if entry["kind"] == "two":
        assert a["block"] != a["block2"] != ""
        assert a["ratio"] >= 1.3
    assert same(columns, load_world(world).simulate(answer, hidden_in(answer), answer["seed"]))


@pytest.mark.parametrize("world", NAMES)
def test_an_item_is_drawn_alike_whatever_was_drawn_before(world):
    number, entry = len(entries(world)) - 1, entries(world)[-1]
    before = item_of(world, number)
    load_world(world).draw(SEED + 1, number, entry)
    after = load_world(world).draw(SEED, number, entry)
    assert (after.answer, after.baseline) == (before.answer, before.baseline)
    assert same(after.columns, before.columns)


@pytest.mark.parametrize("name", NAMES)
def test_at_identity_an_effect_changes_no_bit(name):
    world = load_world(name)
    answer = world.draw(4, 1, {"kind": "none", "mv": True, "plant": "foptd"}).answer
    assert answer["plant"] == "foptd"
    if name == "own":  # a mismatch counts from the baseline's plant
        case = answer["case"]
        case["nominal"] = (case["K"], case["T"], case["Td"])
        assert not case["log_is_late"]
    plain = world.simulate(answer, [], 3)
    for effect, known in WORLD_EFFECTS.items():
        parameters = dict(known.identity)
        changed = world.simulate(answer, [{"effect": effect, "parameters": parameters}], 3)
        assert same(plain, changed), effect


@pytest.mark.parametrize("name", NAMES)
def test_a_world_imports_nothing_that_it_judges_nor_effects_that_others_install(name):
    place = load_world(name)
    shared = (
        place.__name__, "results.studies.withheld.distance", "results.studies.withheld.menu",
        "results.studies.withheld.world",
        "simbench.loop.effects", "simbench.detectors.compiled", "simbench.detectors.errors",
    )  # fmt: skip
    for path in Path(place.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                modules.append(node.module)
                assert "EFFECTS" not in [a.name for a in node.names], path.name
            ours = [m for m in modules if m.split(".")[0] in _OURS]
            assert all(m.startswith(shared) for m in ours), f"{path.name}: {ours}"


_OURS = ("simbench", "scenarios", "detectors", "results")
