"""Every world keeps the contract: pure draws, loadable baselines, answers in the vocabulary's words, loops that run again."""

import json

import numpy as np
import pytest

from detectors.errors import ParameterError, UnknownName
from scenarios.spec import Loop
from simbench.blind.making import PLANNED, make
from simbench.blind.world import WORLDS
from simbench.loop.effects import BLOCKS, EFFECTS

ENTRIES = (
    {"kind": "none", "mv": False},
    {"kind": "single", "effect": "gain_mismatch", "strength": "strong", "mv": True},
    {"kind": "two", "mv": True},
)


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
    draw = WORLDS.load(name).draw
    item, again = draw(5, 3, entry), draw(5, 3, entry)
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
    assert sorted(PLANNED) == sorted(EFFECTS)
