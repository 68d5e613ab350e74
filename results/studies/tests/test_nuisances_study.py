"""What nuisances cost: the figures by hand, and that each nuisance is taken out."""

from __future__ import annotations

import copy

import numpy as np
import pandas as pd
import pytest

from results.studies.nuisances import NUISANCES, table
from results.studies.worlds.refinery import drawing
from simbench.scenarios.spec import Loop


def row(kind, answer, right, p=0.8, **more):
    return {
        "kind": kind, "strength": "medium", "block": "valve", "answer": answer, "right": right,
        "block_right": right, "p": p, "lacks": float(kind != "none"), "size": 4, "covered": True,
        "near": True,
    } | more  # fmt: skip


def test_the_figures_by_hand():
    rows = [row("single", "stiction", True), row("single", "none", False, 0.4, covered=False)]
    rows += [row("none", "none", True), row("none", "unknown", False, size=8)]
    rows += [row("none", "noise", False, near=False), row("foreign", "unknown", True)]
    said = {line[:60].strip(): line[60:].strip() for line in table(pd.DataFrame(rows))}
    assert said["first effect, medium and strong"].startswith("0.500")
    assert said["none: an effect named"].startswith("0.333")
    assert said["none: unknown"].startswith("0.333")
    assert said["set holds the truth, 4.7 answers in the mean"].startswith("0.833")
    assert said["AUC of 'is anything lacking?', single"].startswith("1.000")
    assert said["right where p is 0 to 0.5"].startswith("0.000")
    assert said["right where an effect is named and not near"].startswith("0.000")


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
