"""The mill's records: as visible as stated, and distinguished by nothing but the effect."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import results.studies.worlds.mill as mill
from results.studies.worlds.mill.drawing import ALIKE, sound
from results.studies.worlds.mill.loops import baseline, draw_loop
from results.studies.worlds.mill.oracle import BANDS, cloud, ratio, strength_of
from results.studies.worlds.mill.statistics import floors, measure, names
from simbench.blind.world import WORLD_EFFECTS
from simbench.detectors.errors import ParameterError, UnknownName
from simbench.scenarios.spec import Loop

SEED = 404
ENTRIES = [
    {"kind": "single", "effect": e, "strength": list(BANDS)[i % 3], "mv": True}
    for i, e in enumerate(WORLD_EFFECTS)
]
ENTRIES += [{"kind": "two", "mv": True}, {"kind": "none", "mv": False}]


@cache
def drawn(number):
    return mill.draw(SEED, number, ENTRIES[number])


def hidden_in(answer):
    pairs = (("effect", "parameters"), ("effect2", "parameters2"))
    known = [{"effect": answer[e], "parameters": answer[p]} for e, p in pairs]
    return [e for e in known if e["effect"] not in ("", "none")]


@pytest.mark.parametrize(
    "number", [pytest.param(i, marks=[pytest.mark.slow] * (i % 8 != 1)) for i in range(24)]
)
def test_a_record_is_sound_and_as_visible_as_stated_under_fresh_seeds_too(number):
    columns, _, answer = drawn(number)
    case, hidden = answer["case"], hidden_in(answer)
    limits = [answer["parameters"].get(k, x) for k, x in (("lo", 0.0), ("hi", 100.0))]
    assert sound(case, columns, tuple(limits))
    if ENTRIES[number]["kind"] == "two":
        assert answer["ratio"] >= 2.0
        assert not any(answer["effect"] in row and answer["effect2"] in row for row in ALIKE)
    if ENTRIES[number]["kind"] == "single":
        assert answer["strength"] == strength_of(answer["ratio"])
        healthy = cloud(case, [], list(range(900, 924)))
        value, _ = ratio(case, hidden, list(range(800, 808)), healthy)
        low, high = BANDS[answer["strength"]]
        assert 0.7 * low <= value <= 1.4 * high


def test_nothing_is_not_visible():
    for number in range(2):
        case = draw_loop(np.random.default_rng(number))
        value, _ = ratio(case, [], [1, 2, 3, 4, 5], cloud(case, [], list(range(10, 30))))
        assert 0.6 < value < 1.4


@pytest.mark.slow  # every entry is drawn
def test_the_loop_comes_from_seed_and_index_and_not_from_the_effect():
    """No leak by construction: whatever is drawn into a loop, its baseline, length and set point
    were there before.

    A known dead-band belongs to records without a valve effect; other loops are replaced only where
    they cannot hold the effect at the visibility asked for.
    """
    same = []
    for number in range(len(ENTRIES)):
        table, answer = drawn(number)[1:]
        first = draw_loop(
            np.random.default_rng([SEED, number, 0]),
            "foptd" if "time_const" in answer["effect"] else None,
        )
        expected = baseline(first)
        if "valve" in (answer["block"], answer["block2"]):
            expected["valve"] = {"model": "ideal"}
        same.append(expected == table and first["setpoint"] == answer["case"]["setpoint"])
    assert np.mean(same) > 0.6


def test_wishes_are_heard_and_nonsense_is_refused():
    for plant in ("foptd", "integrating"):
        assert mill.draw(1, 1, {"kind": "none", "plant": plant}).answer["plant"] == plant
    for entry, word in (
        ({"kind": "triple"}, "triple"),
        ({"kind": "single", "effect": "stroke_speed", "strength": "weak"}, "stroke_speed"),
        ({"kind": "foreign", "effect": "stiction", "strength": "weak"}, "stiction"),
        ({"kind": "single", "effect": "stiction", "strength": "huge"}, "huge"),
        ({"kind": "none", "plant": "second"}, "second"),
    ):
        with pytest.raises(UnknownName, match=word):
            mill.draw(1, 1, entry)
    slow = {"kind": "single", "effect": "time_constant_mismatch", "strength": "weak"}
    with pytest.raises(ParameterError, match="foptd"):
        mill.draw(1, 1, slow | {"plant": "integrating"})


def test_drawn_loops_keep_to_the_ranges_of_the_order():
    cases = [draw_loop(np.random.default_rng([8, i])) for i in range(40)]
    assert 0.1 < np.mean([c["plant"]["type"] == "integrating" for c in cases]) < 0.6
    assert 0.3 < np.mean([c["setpoint"]["kind"] == "constant" for c in cases]) < 0.7
    assert {c["plant"]["K"] > 0 for c in cases} == {True, False}
    for c in cases:
        T = c["plant"].get("T")
        if T is not None:
            assert 3.0 <= T / c["Ts"] <= 40.0
            assert 0.045 <= c["plant"]["Td"] / T <= 1.51
        assert c["transmitter"]["count"] <= c["noise"]["std"] / 5.0
        assert 0.19 <= c["known_band"] <= 1.0 or c["known_band"] == 0.0
        assert 0.0003 * c["span"] * 0.28 <= c["noise"]["std"] <= 0.5 * 0.031 * c["span"]
        assert abs(c["nominal"]["K"] / c["plant"]["K"] - 1.0) <= 0.101
        Loop.from_table(baseline(c))


def test_statistics_are_phase_free_and_free_of_units_but_for_sizes():
    rng = np.random.default_rng(0)
    op, pv = 50.0 + np.cumsum(rng.standard_normal(2000)) * 0.1, rng.standard_normal(2000)
    x = measure({"sp": np.full(2000, 1.0), "op": op, "pv": pv}, 1.0, 0)
    assert x.shape == floors().shape == (len(names()),)
    assert np.all(np.isfinite(x))
    scaled = measure({"sp": np.full(2000, 10.0), "op": op, "pv": 7.0 * pv + 3.0}, 1.0 / 7.0, 0)
    units = [
        n.startswith(("power error", "size", "slow of error", "surprise")) and "op" not in n
        for n in names()
    ]
    assert np.array_equal(np.abs(scaled - x) > 1e-6, units)
