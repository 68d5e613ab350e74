"""Every world keeps the contract: pure draws, loadable baselines, answers in the vocabulary's
words, loops that run again.
"""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from detectors.errors import ParameterError, UnknownName
from results.studies.worlds import NAMES, WORLDS
from results.studies.worlds.mill import drawing as mill
from results.studies.worlds.refinery import drawing as refinery
from simbench.blind.making import Plan, make
from simbench.blind.world import WORLD_EFFECTS
from simbench.loop.effects import BLOCKS
from simbench.loop.effects import EFFECTS as VOCABULARY

MISMATCH = {"kind": "single", "effect": "gain_mismatch", "strength": "strong", "mv": True}


@pytest.mark.parametrize("name", NAMES)
def test_a_world_names_foreign_kinds_in_at_least_four_blocks(name):
    foreign = WORLDS.load(name).FOREIGN
    assert len(foreign) >= 8
    assert len(set(foreign.values())) >= 4
    assert set(foreign.values()) <= set(BLOCKS)
    assert not set(foreign) & set(WORLD_EFFECTS)


@pytest.mark.parametrize("name", NAMES)
def test_the_loop_of_an_answer_runs_again_with_any_effect_in_place_of_the_true_one(name):
    world = WORLDS.load(name)
    answer = json.loads(json.dumps(world.draw(5, 1, MISMATCH).answer))
    plain = world.simulate(answer, [], 9)
    noisy = world.simulate(
        answer, [{"effect": "noise", "parameters": {"factor": 30.0, "std": 0.0}}], 9
    )
    assert np.std(np.diff(noisy["pv"])) > np.std(np.diff(plain["pv"]))
    assert not np.array_equal(world.simulate(answer, [], 9, nominal=True)["pv"], plain["pv"])


def test_an_effect_that_cannot_act_in_a_loop_is_refused():
    world = WORLDS.load("own")
    item = world.draw(5, 0, {"kind": "none", "mv": False, "plant": "integrating"})
    with pytest.raises(ParameterError, match="foptd plant only"):
        world.simulate(
            item.answer, [{"effect": "time_constant_mismatch", "parameters": {"factor": 2.0}}], 1
        )


def test_an_unknown_world_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(UnknownName, match="own"):
        make(tmp_path / "set", tmp_path / "key", seed=1, world="owm")
    assert not any(tmp_path.iterdir())


def test_the_plan_holds_every_effect_that_worlds_draw_and_the_vocabulary_knows_them_all():
    assert list(Plan().effects) == list(WORLD_EFFECTS)
    assert set(WORLD_EFFECTS) <= set(VOCABULARY)


EFFECT = '''"""Sulking: PV stops for a while."""

SOURCE, BLOCK, PARAMETERS, ACTS = "made up", "a sixth block", {}, "record"


def apply(record, p, rng):
    """Do nothing."""
'''

WORK = """
import json, sys

import numpy as np

from simbench.blind.making import Plan, make
from results.studies.worlds import NAMES, WORLDS
from results.studies.worlds.mill import drawing as mill
from results.studies.worlds.refinery import drawing as refinery
from simbench.loop.effects import EFFECTS

worlds = [WORLDS.load(name).TITLE for name in NAMES]
pairs = [
    list(world._pair(np.random.default_rng(seed)))
    for world in (mill, refinery)
    for seed in range(40)
]
plan = Plan(per_cell=1, none=0, two=0, foreign=0, effects=("noise",), strengths=("strong",))
make(sys.argv[1] + "/set", sys.argv[1] + "/key", seed=3, plan=plan, world="mill")
print(json.dumps({"known": list(EFFECTS), "worlds": worlds, "pairs": pairs}))
"""


def test_worlds_draw_the_same_bits_while_another_distributions_effect_is_installed(tmp_path):
    about = tmp_path / "strange-1.0.dist-info"
    about.mkdir()
    (tmp_path / "sulking.py").write_text(EFFECT)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[simbench.effects]\nsulking = sulking\n")
    done = subprocess.run(
        [sys.executable, "-c", WORK, str(tmp_path)], capture_output=True, text=True, timeout=300,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert set(found["known"]) - set(VOCABULARY) == {"sulking"}
    assert len(found["worlds"]) == len(NAMES)
    # a pair is drawn from all effects that a world knows
    assert found["pairs"] == [
        list(w._pair(np.random.default_rng(s))) for w in (mill, refinery) for s in range(40)
    ]
    plan = Plan(per_cell=1, none=0, two=0, foreign=0, effects=("noise",), strengths=("strong",))
    make(tmp_path / "own", tmp_path / "own.key", seed=3, plan=plan, world="mill")
    with_it, without = (sorted((tmp_path / name / "records").iterdir()) for name in ("set", "own"))
    assert [p.read_bytes() for p in with_it] == [p.read_bytes() for p in without]
