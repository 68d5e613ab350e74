"""Sites with the nuisances of another author: what they draw."""

from __future__ import annotations

import pytest

from results.studies.worlds import nuisances, recipes
from results.studies.worlds.refinery import drawing
from results.studies.worlds.refinery.loops import REFINERY
from results.studies.worlds.refinery.simulation import build
from simbench.scenarios.spec import Loop

ENTRY = {"kind": "none", "mv": True}


def test_sites_are_the_same_for_every_seed_and_none_is_one_of_the_recipes():
    sites = [nuisances.site(k) for k in range(recipes.SITES)]
    assert sites == [nuisances.site(k) for k in range(recipes.SITES)]
    plain = {recipes.site(k).loads for k in range(recipes.SITES)}
    assert not plain & {s.loads for s in sites}


def test_a_stated_filter_is_in_the_file_and_not_in_its_plant():
    habits = REFINERY._replace(filter=0.3, filter_stated=1.0, knows=0.0, higher_order=0.0)
    for i in range(4):
        item = drawing.draw(5, i, ENTRY, habits)
        case, file = item.answer["case"], Loop.from_table(item.baseline)
        [stated] = item.baseline["effect"]
        assert stated == {"name": "sensor_lag", "tau": pytest.approx(case["filter"], rel=1e-3)}
        assert file.plant.T == pytest.approx(case["plant"]["T"], rel=1e-3) or file.integrating
        # the noise that a file states enters before the filter, in the simulation of the file too
        wanted = case["noise"]["std"] * case["noise"]["gain"]
        assert file.noise.std == pytest.approx(wanted, rel=1e-3)
        nominal = build(case, nominal=True)
        assert nominal.sensor.lag == case["filter"]
        assert nominal.noise_std == pytest.approx(wanted)
