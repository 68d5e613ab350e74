"""What the refinery draws: the effect as visible as stated, and nothing else that reveals it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds import refinery
from results.studies.worlds.refinery import drawing, foreign, loops, oracle, search, simulation
from simbench.detectors.errors import ParameterError

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


def hidden_in(answer):
    first = {"effect": answer["foreign"] or answer["effect"], "parameters": answer["parameters"]}
    second = {"effect": answer["effect2"], "parameters": answer["parameters2"]}
    return [] if answer["kind"] == "none" else [first, *([second] if answer["effect2"] else [])]


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


@pytest.mark.slow
def test_answers_keep_to_their_bounds_and_ratios_to_their_bands_when_measured_again():
    for number, (entry, item) in enumerate(drawn()):
        a = item.answer
        if entry["kind"] == "foreign":
            for name, (_, low, high) in foreign.PARAMETERS[a["foreign"]].items():
                assert low <= a["parameters"][name] <= high
        if "stiction" in (a["effect"], a["effect2"]):
            assert a["parameters" if a["effect"] == "stiction" else "parameters2"]["S"] >= 0.3
        if entry["kind"] in ("single", "foreign"):
            low, high = oracle.BANDS[entry["strength"]]
            assert low <= a["ratio"] <= high
        if entry["kind"] == "two":
            assert a["ratio"] >= 2.0
            assert not any({a["effect"], a["effect2"]} <= same for same in drawing.SAME)
        # a fresh measurement with other seeds on a handful: the same order of visibility
        if entry["kind"] == "single" and number % 7 == 0:
            seeds = np.arange(100, 100 + search.CLOUD + search.SHOWN)
            ratio = search.Bench(a["case"], [], seeds).ratio(hidden_in(a))
            assert 0.5 * a["ratio"] < ratio < 2.0 * a["ratio"], entry


@pytest.mark.slow
def test_classes_of_the_loop_do_not_depend_on_the_entry():
    changed = 0
    for i, (entry, item) in enumerate(drawn()):
        a = item.answer
        if drawing.NEEDS_FOPTD & {entry.get("effect"), a["effect"], a["effect2"]}:
            continue
        expected = loops.draw_classes(np.random.default_rng([11, i, 2]))
        classes = (a["case"]["n"], a["case"]["Ts"], a["case"]["controller"]["type"])
        changed += classes != tuple(expected[k] for k in ("n", "Ts", "controller"))
    assert changed <= 0.1 * len(drawn())


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


@pytest.mark.parametrize(
    ("effect", "number"),
    [
        ("gain_mismatch", "K"),
        pytest.param("time_constant_mismatch", "T", marks=pytest.mark.slow),
    ],
)
def test_mismatch_is_the_ratio_to_the_baseline(effect, number):
    entry = {"kind": "single", "effect": effect, "strength": "medium", "mv": False}
    a = refinery.draw(8, 2, entry).answer
    expected = a["parameters"]["factor"] * a["case"]["baseline"]["plant"][number]
    plant = search.prepared(a["case"], hidden_in(a)).plant
    assert getattr(plant, number) == pytest.approx(expected)


def test_wrong_entries_and_effects_are_refused_in_one_sentence():
    answer = a_loop(plant="integrating")
    answer["case"]["mv"] = True
    for effect, parameters in (
        ("time_constant_mismatch", {"factor": 2.0}),
        ("stiction", {"S": -1.0, "J": 0.0}),
        ("stiction", {"X": 1.0}),
        ("heat_recycle", {"share": 0.5, "delay": 3.0}),
        ("range_clip", {}),
    ):
        with pytest.raises(ParameterError):
            refinery.simulate(answer, [{"effect": effect, "parameters": parameters}], 1)
    with pytest.raises(ParameterError):
        refinery.draw(0, 0, {"kind": "single", "effect": "noise", "strength": "enormous"})
    with pytest.raises(LookupError, match="did you mean 'stiction'"):
        refinery.draw(0, 0, {"kind": "single", "effect": "stictoin", "strength": "weak"})
    with pytest.raises(ParameterError):
        refinery.draw(0, 0, {"kind": "three"})


def test_an_entry_no_loop_can_hold_is_given_up(monkeypatch):
    monkeypatch.setattr(drawing, "LOOPS", 3)
    monkeypatch.setattr(search, "sized", lambda *_: (_ for _ in ()).throw(search.Misfit))
    with pytest.raises(ParameterError, match="none of 3 drawn loops"):
        refinery.draw(0, 0, {"kind": "single", "effect": "noise", "strength": "weak"})
