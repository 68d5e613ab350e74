"""What the refinery draws: the plant of the baseline, and cascades under another load."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds import refinery
from results.studies.worlds.refinery import loops, simulation

STRENGTHS = ("weak", "medium", "strong")
ENTRIES = [
    {"kind": kind, "effect": e, "strength": STRENGTHS[i % 3], "mv": i % 2 == 0}
    for kind, effects in (("single", WORLD_EFFECTS), ("foreign", refinery.FOREIGN))
    for i, e in enumerate(effects)
]
ENTRIES += [{"kind": "none"}] * 3 + [{"kind": "two", "mv": False}, {"kind": "two", "mv": True}]


@cache
def drawn():
    return [(e, refinery.draw(11, i, e)) for i, e in enumerate(ENTRIES)]


def a_loop(**wish):
    """A plain foptd PI loop without nuisance, as a drawn answer would hold it."""
    rng = np.random.default_rng([5, 0])
    quiet = dict.fromkeys(("averaging", "exceptions", "late", "known_play"), False)
    quiet |= {"noise": "white", "load": "ou", "controller": "PI", "sp": "constant", "n": 1200}
    case = None
    while case is None:
        classes = loops.draw_classes(rng, wish.get("plant", "foptd"))
        case = loops.draw_case(rng, classes | quiet | wish)
    case["controller"]["op_step"] = 0.0
    return {"case": case}


def test_nominal_runs_the_plant_of_the_baseline():
    answer = a_loop(higher_order=True)
    plant = simulation.build(answer["case"], nominal=True).plant
    base = answer["case"]["baseline"]["plant"]
    assert (plant.K, plant.T, plant.Td, plant.lag1) == (base["K"], base["T"], base["Td"], 0.0)


def test_a_cascade_sets_the_same_set_points_under_another_load():
    answer = a_loop(sp="cascade") | {"mv": True}
    answer["case"]["mv"] = True
    a, b = (refinery.simulate(answer, [], seed) for seed in (3, 4))
    assert np.array_equal(a["sp"], b["sp"])
    assert a["pv"].std() == pytest.approx(b["pv"].std(), rel=0.5)
