"""Sites with habits of their own: drawn once for all seeds, and what a baseline says of them."""

from __future__ import annotations

import numpy as np
import pytest

from results.studies.worlds import recipes
from results.studies.worlds.refinery import drawing
from results.studies.worlds.refinery.loops import REFINERY
from simbench.scenarios.spec import Loop

ENTRY = {"kind": "none", "mv": True}


def drawn_with(**habits):
    """The first items of a site that differs from the refinery in some habits."""
    return [drawing.draw(5, i, ENTRY, REFINERY._replace(**habits)) for i in range(4)]


def test_sites_are_the_same_for_every_seed_and_unlike_each_other():
    sites = [recipes.site(k) for k in range(recipes.SITES)]
    assert sites == [recipes.site(k) for k in range(recipes.SITES)]
    assert len(set(sites)) == recipes.SITES
    assert {recipes.part(k) for k in range(0, recipes.SITES, 2)} == {"build"}
    assert {recipes.part(k) for k in range(1, recipes.SITES, 2)} == {"judge"}


@pytest.mark.parametrize("number", [1, 24])
def test_an_item_names_its_site_and_runs_again(number):
    item = recipes.draw(5, number, ENTRY)
    assert recipes.site_of(item.answer) == recipes.site_at(number)
    Loop.from_table(item.baseline)
    again = recipes.simulate(item.answer, [], item.answer["seed"])
    assert set(again) == set(item.columns)
    assert all(np.array_equal(again[name], x) for name, x in item.columns.items())


def test_a_baseline_states_derivative_action_and_its_weights():
    controllers = [item.baseline["controller"] for item in drawn_with(PID=1.0, P=0.0)]
    assert {c["type"] for c in controllers} == {"PID"}
    assert all(
        c["Td"] > 0.0 and c["N"] == 8.0 and {"b", "c", "form"} <= set(c) for c in controllers
    )
    assert all(
        set(i.baseline["controller"]) == {"type", "Kc", "Ti", "direction"}
        for i in drawn_with(P=0.0)
    )


def test_a_step_test_shows_the_lags_of_sound_instruments_in_the_plant():
    for item in drawn_with(actuator=0.3, filter=0.3, knows=0.0, higher_order=0.0):
        case, model = item.answer["case"], item.baseline["plant"]
        small = case["actuator"] + case["filter"]
        assert 0.0 < small < 0.6 * case["time"]
        late = sum(model.get(k, 0.0) - (case["plant"][k] or 0.0) for k in ("T", "Td"))
        assert late == pytest.approx(small, rel=0.1)


def test_a_clock_is_early_or_late_and_rows_are_lost_in_the_archive_alone():
    for item in drawn_with(jitter=0.05, lost=0.01):
        t, case = item.columns["t"], item.answer["case"]
        off = t / case["Ts"] - np.round(t / case["Ts"])
        assert 0.0 < np.ptp(off) <= 0.05
        assert {x.size for x in item.columns.values()} == {t.size}
        assert case["n"] * 0.98 < t.size < case["n"]


def test_what_a_baseline_says_of_load_and_noise():
    loads = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for item in drawn_with(load_told=1.0, loads=loads, noise_known=0.1):
        case = item.answer["case"]
        [load] = item.baseline["disturbance"]
        assert load["amplitude"] == pytest.approx(case["load"]["scale"], rel=1e-3)
        assert load["period"] == pytest.approx(case["load"]["time"], rel=1e-3)
        assert 0.9 <= item.baseline["noise"]["std"] / case["noise"]["std"] <= 1.1
        assert item.baseline["noise"]["std"] != case["noise"]["std"]
