"""What nuisances cost: each is drawn and taken out of the same seed."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from results.studies.nuisances import NUISANCES
from results.studies.worlds.refinery import drawing
from simbench.scenarios.spec import Loop


@pytest.mark.parametrize("name", [n for n, one in NUISANCES.items() if one.take_out])
def test_a_nuisance_is_drawn_and_taken_out_of_the_same_seed(name):
    one = NUISANCES[name]
    entry = {"kind": one.kind, "effect": one.effect, "strength": "medium", "mv": False}
    item = drawing.draw(5, 0, entry, one.habits)
    truth = copy.deepcopy(item.answer)
    one.take_out(truth["case"])
    assert truth["case"] != item.answer["case"]
    hidden = [{"effect": one.effect, "parameters": truth["parameters"]}] if one.effect else []
    columns = drawing.simulate(truth, hidden, truth["seed"])
    assert any(not np.array_equal(columns[k], item.columns[k]) for k in columns)
    Loop.from_table(truth["case"]["baseline"])
