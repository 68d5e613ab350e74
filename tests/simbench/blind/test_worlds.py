"""Every world keeps the contract: pure draws, loadable baselines, answers in the vocabulary's words, loops that run again."""

import json
import os
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from detectors.errors import ParameterError, UnknownName
from scenarios.spec import Loop
from simbench.blind.making import Plan, make
from simbench.blind.world import EFFECTS, WORLDS
from simbench.loop.effects import BLOCKS
from simbench.loop.effects import EFFECTS as VOCABULARY

ENTRIES = (
    {"kind": "none", "mv": False},
    {"kind": "single", "effect": "gain_mismatch", "strength": "strong", "mv": True},
    {"kind": "two", "mv": True},
)


@cache
def drawn(world, kind):
    return WORLDS.load(world).draw(5, 3, next(entry for entry in ENTRIES if entry["kind"] == kind))


@pytest.mark.parametrize("name", WORLDS.names())
def test_a_world_names_foreign_kinds_in_at_least_four_blocks(name):
    foreign = WORLDS.load(name).FOREIGN
    assert len(foreign) >= 8
    assert len(set(foreign.values())) >= 4
    assert set(foreign.values()) <= set(BLOCKS)
    assert not set(foreign) & set(EFFECTS)


@pytest.mark.parametrize("name", WORLDS.names())
@pytest.mark.parametrize("entry", ENTRIES, ids=lambda e: e["kind"])
def test_a_draw_is_pure_and_says_the_truth_in_the_vocabularys_words(name, entry):
    item, again = drawn(name, entry["kind"]), WORLDS.load(name).draw(5, 3, entry)
    assert {"t", "sp", "op", "pv"} <= set(item.columns)
    assert ("mv" in item.columns) == item.answer["mv"] == entry["mv"]
    assert all(np.array_equal(x, again.columns[c]) for c, x in item.columns.items())
    assert json.dumps(item.answer) == json.dumps(again.answer)
    Loop.from_table(item.baseline, "baseline")
    assert item.answer["kind"] == entry["kind"]
    for effect, table in (("effect", "parameters"), ("effect2", "parameters2")):
        if item.answer[effect] in EFFECTS:
            assert set(item.answer[table]) <= set(EFFECTS[item.answer[effect]].parameters)


@pytest.mark.parametrize("name", WORLDS.names())
def test_the_loop_of_an_answer_runs_again_with_any_effect_in_place_of_the_true_one(name):
    world = WORLDS.load(name)
    answer = json.loads(json.dumps(world.draw(5, 1, ENTRIES[1]).answer))
    plain = world.simulate(answer, [], 9)
    assert all(np.array_equal(x, world.simulate(answer, [], 9)[c]) for c, x in plain.items())
    noisy = world.simulate(answer, [{"effect": "noise", "parameters": {"factor": 30.0, "std": 0.0}}], 9)
    assert np.std(np.diff(noisy["pv"])) > np.std(np.diff(plain["pv"]))
    assert not np.array_equal(world.simulate(answer, [], 9, nominal=True)["pv"], plain["pv"])


def test_an_effect_that_cannot_act_in_a_loop_is_refused():
    world = WORLDS.load("own")
    item = world.draw(5, 0, {"kind": "none", "mv": False, "plant": "integrating"})
    with pytest.raises(ParameterError, match="foptd plant only"):
        world.simulate(item.answer, [{"effect": "time_constant_mismatch", "parameters": {"factor": 2.0}}], 1)


def test_an_unknown_world_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(UnknownName, match="own"):
        make(tmp_path / "set", tmp_path / "key", seed=1, world="owm")
    assert not any(tmp_path.iterdir())


def test_the_plan_holds_every_effect_of_the_vocabulary():
    assert sorted(Plan().effects) == sorted(VOCABULARY)


EFFECT = '''"""Sulking: PV stops for a while."""

SOURCE, BLOCK, PARAMETERS, ACTS = "made up", "a sixth block", {}, "record"


def apply(record, p, rng):
    """Do nothing."""
'''

WORK = """
import json, sys
from simbench.blind.making import Plan, make
from simbench.blind.world import WORLDS
from simbench.loop.effects import EFFECTS

pair, folder = json.loads(sys.argv[1]), sys.argv[2]
drawn = {name: WORLDS.load(name).draw(5, 3, pair) for name in WORLDS.names()}
plan = Plan(per_cell=1, none=0, two=0, foreign=0, effects=("noise",), strengths=("strong",))
make(f"{folder}/set", f"{folder}/key", seed=3, plan=plan, world="mill")
items = {name: [item.answer, {c: x.tobytes().hex() for c, x in item.columns.items()}] for name, item in drawn.items()}
print(json.dumps({"known": list(EFFECTS), "items": items}))
"""


def test_worlds_draw_the_same_bits_while_another_distributions_effect_is_installed(tmp_path):
    about = tmp_path / "strange-1.0.dist-info"
    about.mkdir()
    (tmp_path / "sulking.py").write_text(EFFECT)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[simbench.effects]\nsulking = sulking\n")
    done = subprocess.run(
        [sys.executable, "-c", WORK, json.dumps(ENTRIES[2]), str(tmp_path)], capture_output=True, text=True, timeout=300,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert set(found["known"]) - set(VOCABULARY) == {"sulking"}
    assert len(list((tmp_path / "set" / "records").iterdir())) == 2
    # a pair is drawn from all effects that a world knows
    for name in WORLDS.names():
        item = drawn(name, "two")
        columns = {c: x.tobytes().hex() for c, x in item.columns.items()}
        assert found["items"][name] == [json.loads(json.dumps(item.answer)), columns]
