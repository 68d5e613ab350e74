"""The mill's parts against slow twins and textbook cases: plants, controllers, valves, archive,
loads.
"""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

from results.studies.worlds.mill import archive, controller, nature, valve
from results.studies.worlds.mill.controller import PRODUCTS, RULES
from results.studies.worlds.mill.loop import Law
from results.studies.worlds.mill.plant import discretise, fitted, margins

TWIN = runpy.run_path(str(Path(__file__).with_name("mill_twin.py")))
PlainController, step_response = TWIN["PlainController"], TWIN["step_response"]
kano, he_flow_chart, sliding_stem = TWIN["kano"], TWIN["he_flow_chart"], TWIN["sliding_stem"]
FAMILY = {
    controller.PROPORTIONAL: "proportional",
    controller.VELOCITY: "velocity",
    controller.CONDITIONAL: "conditional",
    controller.TRACKING: "tracking",
    controller.CLAMPED: "clamped",
}


def sampled_step(plant, Ts, n):
    g = discretise(plant, Ts)
    x, w, y = np.zeros(len(g.c)), np.ones(n), []
    for k in range(n):
        y.append(float(g.c @ x))
        late = w[k - g.delay] if k >= g.delay else 0.0
        later = w[k - g.delay - 1] if k >= g.delay + 1 else 0.0
        x = g.A @ x + g.old * later + g.new * late
    return np.array(y)


@pytest.mark.parametrize("Td", [0.0, 0.3, 1.0, 2.75, 6.999999])
@pytest.mark.parametrize("lags", [(), (0.9,)])
@pytest.mark.parametrize("kind", ["foptd", "integrating"])
def test_sampled_plant_passes_through_the_continuous_step_response(kind, lags, Td):
    Ts = 1.0
    plant = {"type": kind, "K": -1.7, "T": 7.0, "Td": Td, "lags": list(lags)}
    truth = [step_response(k * Ts, kind, -1.7, 7.0, Td, lags) for k in range(60)]
    assert np.allclose(sampled_step(plant, Ts, 60), truth, atol=1e-10)


def test_first_order_fit_agrees_with_the_plant_of_higher_order():
    T, Td = fitted(10.0, 2.0, [1.5, 1.0])
    assert T + Td == pytest.approx(14.5)
    t = np.arange(0.0, 60.0, 0.5)
    true = np.array([step_response(s, "foptd", 1.0, 10.0, 2.0, (1.5, 1.0)) for s in t])
    fit = np.array([step_response(s, "foptd", 1.0, T, Td) for s in t])
    naive = np.array([step_response(s, "foptd", 1.0, 10.0, 4.5) for s in t])
    assert np.max(np.abs(true - fit)) < 0.05
    assert np.sum((true - fit) ** 2) < 0.7 * np.sum((true - naive) ** 2)
    assert fitted(None, 2.0, [1.5, 1.0]) == (None, 4.5)


def test_margins_say_unstable_where_the_loop_grows():
    # integrator with one sample of hold: 1 - K Kc crosses the unit circle at K Kc = 2
    for gain, crosses in ((0.5, 0.25), (1.9, 0.95), (2.2, 1.1)):
        _, cross = margins(
            discretise({"type": "integrating", "K": 1.0, "Td": 0.0}, 1.0), gain, 0.0, 1.0, 0.0
        )
        assert cross == pytest.approx(crosses, rel=0.02)


def law_of(product, Kc, ki, shares, limits=(0.0, 100.0), back=0.5):
    return Law(product, 1.0, Kc, ki, *shares, back, *limits, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", PRODUCTS)
@pytest.mark.parametrize("limits", [(0.0, 100.0), (45.0, 56.0)])
def test_products_agree_with_their_manuals(name, limits):
    product, Kc, Ti, Ts, tracking = PRODUCTS[name], 1.8, 12.0, 1.5, 0.4
    twin = PlainController(FAMILY[product.law], product.rule, (Kc, Ti), Ts, 50.0, limits, tracking)
    law = law_of(
        product.law,
        Kc,
        Kc * Ts / Ti,
        RULES[product.rule],
        limits=limits,
        back=min(1.0, Ts / (tracking * Ti)),
    )
    state = np.array([50.0, 0.0, 50.0])
    e = 3.0 * np.sin(np.arange(200) / 9.0) + np.random.default_rng(1).standard_normal(200)
    ours = [controller.control(x, state, law) for x in e]
    theirs = [twin(x) for x in e]
    assert np.allclose(ours, theirs, atol=1e-9)
    assert limits == (0.0, 100.0) or (min(ours) == 45.0 and max(ours) == 56.0)


def test_products_of_one_rule_are_one_law_while_no_limit_is_reached():
    e = np.random.default_rng(2).standard_normal(100)
    for rule, shares in RULES.items():
        runs = []
        for product in (
            p for p in PRODUCTS.values() if p.rule == rule and p.law != controller.PROPORTIONAL
        ):
            state = np.array([50.0, 0.0, 50.0])
            law = law_of(product.law, 0.7, 0.1, shares)
            runs.append([controller.control(x, state, law) for x in e])
        assert len(runs) >= 3
        assert np.allclose(runs, runs[0], atol=1e-9)


@pytest.mark.parametrize(
    "law", [controller.VELOCITY, controller.CONDITIONAL, controller.TRACKING, controller.CLAMPED]
)
def test_return_from_manual_is_bumpless(law):
    state = np.array([50.0, 0.0, 50.0])
    controller.follow(law, 2.5, state, 1.3, 61.0)
    settings = law_of(law, 1.3, 0.0, RULES["backward"])
    assert controller.control(2.5, state, settings) == pytest.approx(61.0)


def positions(model, op, S, J):
    state = np.zeros(valve.STATES)
    state[0] = state[2] = op[0]
    fs, fd = valve.friction_numbers(S, J)
    return np.array([valve.friction(valve.FRICTION[model][0], u, state, fs, fd) for u in op])


@pytest.fixture(scope="module")
def rough_op():
    rng = np.random.default_rng(3)
    slow = 50.0 + 8.0 * np.sin(np.arange(3000) / 40.0) + rng.standard_normal(3000)
    return np.repeat(np.round(slow, 1), 2)  # holds and exact reversals included


@pytest.mark.parametrize(("S", "J"), [(5.0, 2.0), (3.0, 3.0), (0.6, 0.1), (4.0, 0.0)])
def test_choudhury_equals_kano_and_he_equals_its_flow_chart(rough_op, S, J):
    assert np.allclose(positions("choudhury", rough_op, S, J), kano(rough_op, S, J), atol=1e-9)
    assert np.allclose(positions("he", rough_op, S, J), he_flow_chart(rough_op, S, J), atol=1e-9)


def test_exact_stem_agrees_with_small_steps():
    op = 50.0 + np.cumsum(np.random.default_rng(4).standard_normal(30))
    ours = positions("coulomb", op, 4.0, 1.2)
    assert np.allclose(ours, sliding_stem(op, 4.0, 1.2, valve._SLOW, valve._FAST), atol=5e-3)


@pytest.mark.parametrize("model", valve.FRICTION)
def test_every_friction_model_shows_its_band_and_its_jump(model):
    """On a slow triangle: OP must turn by S, and by S + J where the stem had just stopped; the jump
    is J.
    """
    S, J, rate = 4.0, 1.0, 0.02
    up, down = np.arange(40.0, 60.0, rate), np.arange(60.0, 40.0, -rate)
    op = np.concatenate([up, down, up])
    v = positions(model, op, S, J)
    back = v[len(up) : len(up) + len(down)]
    first = int(np.argmax(back < back[0] - 0.4 * J))
    assert S - rate <= op[len(up)] - down[first] <= S + J + 2 * rate
    assert np.max(np.abs(v[3:] - v[:-3])) == pytest.approx(J, abs=4 * rate)


@pytest.mark.parametrize("model", valve.FRICTION)
def test_a_valve_holds_still_while_op_moves_less_than_its_break_away(model):
    op = 50.0 + 0.9 * np.sin(np.arange(400) / 10.0)
    v = positions(model, op, 4.0, 1.0)
    assert np.all(v == 50.0)


def test_play_deadzone_and_characteristic_on_numbers_of_their_definitions():
    assert [valve.play(u, 50.0, 4.0) for u in (51.9, 52.0, 53.0, 47.0)] == [50.0, 50.0, 51.0, 49.0]
    assert [valve.deadzone(u, 4.0, 50.0) for u in (51.9, 48.0, 55.0, 45.0)] == [
        50.0,
        50.0,
        53.0,
        47.0,
    ]
    assert valve.installed(50.0, 25.0) == pytest.approx(100.0 * (5.0 - 1.0) / 24.0)
    gains = [
        (valve.installed(u + 1e-6, 30.0) - valve.installed(u, 30.0)) / 1e-6
        for u in (0.0, 100.0 - 1e-6)
    ]
    assert gains[1] / gains[0] == pytest.approx(30.0, rel=1e-4)


def test_door_and_exception_report_keep_their_promise():
    x = np.cumsum(np.random.default_rng(5).standard_normal(2000))
    for band in (0.1, 1.0, 5.0):
        y = archive.swinging_door(x, band)
        assert np.max(np.abs(x - y)) <= band + 1e-9
        sent = np.flatnonzero(x == archive.archived(x, [{"stage": "exception", "band": band}], 0))
        assert {0, len(x) - 1} <= set(sent)
    assert np.count_nonzero(np.abs(np.diff(archive.swinging_door(x, 5.0), 2)) > 1e-9) < 200
    straight = np.linspace(3.0, 8.0, 50)
    assert np.allclose(archive.swinging_door(straight, 0.01), straight)
    assert np.array_equal(archive.swinging_door(x, 0.0), x)


def test_digits_spikes_and_average():
    assert archive.significant(np.array([0.0, 1.23456, -98765.0, 0.00123456]), 3).tolist() == [
        0.0,
        1.23,
        -98800.0,
        0.00123,
    ]
    s = archive.spikes(200_000, 0.02, 5.0, np.random.default_rng(6))
    hit = s != 0.0
    assert np.mean(hit) == pytest.approx(0.02, rel=0.05)
    assert not np.any(hit[1:] & hit[:-1])
    assert np.mean(np.abs(s[hit])) == pytest.approx(5.0, rel=0.01)
    assert abs(np.mean(s[hit] > 0.0) - 0.5) < 0.03
    assert archive.archived(np.array([1.0, 3.0, 4.0]), [{"stage": "average"}], 0).tolist() == [
        1.0,
        2.0,
        3.5,
    ]


@pytest.mark.parametrize("kind", [k for k in nature.LOADS if k != "none"])
def test_loads_have_mean_0_and_standard_deviation_1(kind):
    x = np.array([nature.load(kind, 20.0, 20_000, np.random.default_rng(i)) for i in range(8)])
    assert abs(x.mean()) < 0.1
    assert np.sqrt(np.mean(x**2)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("kind", "shape"), [("white", 0.0), ("ar1", 0.6), ("heavy", 5.0), ("flow", 0.0)]
)
def test_noises_have_standard_deviation_1_and_their_own_mark(kind, shape):
    x = nature.noise(kind, shape, 200_000, np.random.default_rng(7))
    assert np.std(x) == pytest.approx(1.0, abs=0.03)
    assert np.mean(x[1:] * x[:-1]) == pytest.approx(0.6 if kind == "ar1" else 0.0, abs=0.02)
    assert (np.mean(x**4) > 4.0) == (kind == "heavy")


def test_set_point_plans():
    t = np.arange(-5.0, 20.0)
    sp = nature.set_point({"value": 10.0, "moves": [[0.0, 0.0, 12.0], [5.0, 10.0, 9.0]]}, t)
    assert sp[t == -1.0] == 10.0
    assert sp[t == 0.0] == 12.0
    assert sp[t == 7.0] == pytest.approx(12.0 - 3.0 * 0.4)
    assert sp[t == 19.0] == 9.0
    wander = nature.set_point(
        {"value": 10.0, "tau": 20.0, "std": 2.0, "seed": 1}, np.arange(200_000.0)
    )
    assert np.std(wander) == pytest.approx(2.0, rel=0.1)
    assert math.isclose(float(np.std(np.diff(wander))), 2.0 / 20.0, rel_tol=0.1)
