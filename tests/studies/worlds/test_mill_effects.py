"""Each effect of the mill does what the contract says, on cases that can be checked by hand; at
identity it does nothing.
"""

from __future__ import annotations

import json
import math
import runpy
from copy import deepcopy
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from detectors.errors import ParameterError, UnknownName, UserError
from results.studies.worlds.mill import controller, loop, valve
from results.studies.worlds.mill.controller import PRODUCTS, RULES
from results.studies.worlds.mill.effects import build
from results.studies.worlds.mill.foreign import KINDS
from results.studies.worlds.mill.loops import draw_loop
from results.studies.worlds.mill.plant import discretise
from simbench.blind.world import WORLD_EFFECTS

TWIN = runpy.run_path(str(Path(__file__).with_name("mill_twin.py")))
FAMILY = {
    controller.PROPORTIONAL: "proportional",
    controller.VELOCITY: "velocity",
    controller.CONDITIONAL: "conditional",
    controller.TRACKING: "tracking",
    controller.CLAMPED: "clamped",
}


def a_case(product="velocity_backward", kind="foptd", **changes):
    """A plain loop without load, noise or archive; what a test wants otherwise comes by keyword."""
    plant = {"type": kind, "K": 0.8, "Td": 2.3, "lags": []}
    tuning = {
        "product": product,
        "direction": "reverse",
        "Kc": 1.1,
        "Ti": 14.0,
        "tracking": 0.5,
        "resolution": 0.0,
    }
    if kind == "foptd":
        plant["T"] = 12.0
    else:
        plant["K"], tuning["Ti"] = 0.06, 40.0
    if product == "bias_p":
        del tuning["Ti"]
    case = {
        "Ts": 1.0,
        "n": 800,
        "warm": 300,
        "span": 100.0,
        "op0": 50.0,
        "plant": plant,
        "nominal": dict(plant),
        "known_band": 0.0,
        "friction": "choudhury",
        "controller": tuning,
        "transmitter": {"count": 0.0, "count_at": 0.0},
        "load": {"kind": "none", "pace": 1.0, "std": 0.0, "mean": 0.0},
        "noise": {"kind": "white", "shape": 0.0, "std": 0.0, "flow": 0.0},
        "setpoint": {
            "kind": "steps",
            "value": 40.0,
            "moves": [[100.0, 100.0, 44.0], [450.0, 450.0, 38.0]],
        },
        "archive": {"pv": [], "op": [], "mv": [], "sp": [], "op_late": False},
    }
    return case | changes


LOAD = {"kind": "wander", "pace": 30.0, "std": 2.0, "mean": 0.0}
NOISE = {"kind": "white", "shape": 0.0, "std": 0.3, "flow": 0.0}


def windy(**changes):
    return a_case(**{"load": LOAD, "noise": NOISE, **changes})


def run(case, effect=None, seed=1, **parameters):
    return build(case, [{"effect": effect, "parameters": parameters}] if effect else []).record(
        seed
    )


def rows(case, effect, seed=1, **parameters):
    """Change of the signals from outside by an effect, and the times."""
    before, _ = build(case, []).rows(seed)
    after, t = build(case, [{"effect": effect, "parameters": parameters}]).rows(seed)
    return {k: after[k].astype(float) - before[k] for k in after}, t


def still(case):
    """The same loop with the controller's hands tied: OP stands at op0."""
    return case | {"controller": case["controller"] | {"Kc": 1e-12, "Ti": 1e6}}


@cache
def drawn_loops():
    """Some drawn loops with a load that can have every effect, and their healthy records."""
    cases = (draw_loop(np.random.default_rng(number), "foptd") for number in range(8))
    return [(c, run(c)) for c in cases if c["load"]["std"] > 0.0 and c["known_band"] == 0.0][:4]


# --- the whole loop against its slow twin


@pytest.mark.parametrize("product", PRODUCTS)
@pytest.mark.parametrize("kind", ["foptd", "integrating"])
def test_loop_agrees_with_sums_of_step_responses_and_plain_controllers(product, kind):
    case = a_case(product, kind, n=150, warm=1, load=LOAD)
    case["setpoint"] = {
        "kind": "steps",
        "value": 40.0,
        "moves": [[20.0, 20.0, 52.0], [90.0, 90.0, 38.0]],
    }
    ours = run(case, "saturation", lo=47.0, hi=58.0)
    signals, _ = build(case, []).rows(1)
    plant = TWIN["SuperposedPlant"](1.0, kind, case["plant"]["K"], case["plant"].get("T"), 2.3)
    tuning, law = case["controller"], PRODUCTS[product]
    plc = TWIN["PlainController"](
        FAMILY[law.law],
        law.rule,
        (tuning["Kc"], tuning.get("Ti")),
        1.0,
        50.0,
        (47.0, 58.0),
        0.5,
    )
    pv, op = [], []
    for sp, load in zip(signals["sp"], signals["load"]):
        pv.append(40.0 + plant.pv())
        op.append(plc(sp - pv[-1]))
        plant.push(op[-1] - 50.0 + load)
    assert min(op) == 47.0
    assert max(op) == 58.0
    assert np.allclose(ours["pv"], pv[1:], atol=1e-8)
    assert np.allclose(ours["op"], op[1:], atol=1e-8)


def test_direct_action_is_the_mirror_image():
    case = windy()
    mirror = deepcopy(case)
    mirror["plant"]["K"] *= -1
    mirror["controller"]["direction"] = "direct"
    mirror["load"]["mean"] = 0.0
    mirror["setpoint"]["value"], mirror["setpoint"]["moves"] = (
        60.0,
        [[100.0, 100.0, 56.0], [450.0, 450.0, 62.0]],
    )
    mirror["noise"] = mirror["noise"] | {"std": -0.3}
    one, two = run(case), run(mirror)
    assert np.allclose(one["op"], two["op"])
    assert np.allclose(one["pv"] - 40.0, 60.0 - two["pv"])


def test_op_logged_late_is_the_same_loop_one_sample_on():
    case = windy()
    late = deepcopy(case)
    late["archive"]["op_late"] = True
    one, two = run(case), run(late)
    for name in ("op", "mv"):
        assert np.array_equal(one[name][:-1], two[name][1:])
    assert np.array_equal(one["pv"], two["pv"])


# --- identity and refusal


@pytest.mark.parametrize("name", [*WORLD_EFFECTS, *KINDS])
def test_at_identity_an_effect_changes_no_bit(name):
    for case, healthy in drawn_loops():
        identity = (WORLD_EFFECTS.get(name) or KINDS[name]).identity
        for parameters in ({}, identity):
            same = run(case, name, **parameters)
            assert all(np.array_equal(healthy[k], same[k]) for k in healthy)


@pytest.mark.parametrize(
    ("case", "effects", "error", "word"),
    [
        (a_case(), [("stiktion", {})], UnknownName, "stiction"),
        (a_case(), [("stiction", {"Q": 1.0})], UnknownName, "Q"),
        (a_case(), [("stiction", {"S": -1.0})], ParameterError, "0 to 100 % of travel"),
        (a_case(), [("valve_lag", {"tau": math.inf})], ParameterError, "tau = inf"),
        (
            a_case(),
            [("quantisation", {"step": 1.0, "at": "plant"})],
            ParameterError,
            "loop, record",
        ),
        (a_case(), [("stiction", {"S": 1.0}), ("stiction", {"S": 2.0})], ParameterError, "twice"),
        (
            a_case(),
            [("stiction", {"S": 1.0}), ("deadzone", {"D": 2.0})],
            ParameterError,
            "another friction",
        ),
        (a_case(known_band=0.5), [("stiction", {"S": 1.0, "J": 0.5})], ParameterError, "dead-band"),
        (
            a_case(kind="integrating"),
            [("time_constant_mismatch", {"factor": 2.0})],
            ParameterError,
            "foptd",
        ),
        (a_case("bias_p"), [("detuning", {"Ti_factor": 2.0})], ParameterError, "no Ti"),
        (a_case(), [("saturation", {"lo": 60.0, "hi": 40.0})], ParameterError, "not below"),
        (a_case(), [("steam_feedforward", {"gain": 0.5})], ParameterError, "without load"),
    ],
)
def test_what_cannot_act_is_refused_in_one_sentence(case, effects, error, word):
    with pytest.raises(error, match=word) as caught:
        build(case, [{"effect": e, "parameters": p} for e, p in effects])
    assert isinstance(caught.value, UserError)


# --- valve


def test_stiction_reports_the_band_and_the_jump_of_its_model():
    case = a_case("bias_p")
    for model, (kind, _) in valve.FRICTION.items():
        case["friction"] = model
        rig = build(case, [{"effect": "stiction", "parameters": {"S": 3.0, "J": 1.0}}])
        assert (rig.element["kind"], rig.element["first"], rig.element["second"]) == (
            kind,
            2.0,
            1.0,
        )
        r = rig.record(1)
        still_moving = np.diff(r["mv"]) != 0.0
        assert np.any(still_moving)
        assert not np.all(still_moving)
        assert np.max(np.abs(r["op"] - r["mv"])) <= 2.0 + 1e-6
    assert (
        build(case, [{"effect": "stiction", "parameters": {"S": 1.0, "J": 2.0}}]).element["kind"]
        == valve.CHOUDHURY
    )


def test_deadband_is_the_play_of_recorded_op_and_adds_to_a_known_one():
    r = run(windy(known_band=0.8), "deadband", S=2.2)
    v = r["mv"][0]
    for u, moved in zip(r["op"][1:], r["mv"][1:]):
        v = max(u - 1.5, min(u + 1.5, v))
        assert moved == pytest.approx(v, abs=1e-9)


def test_deadzone_and_characteristic_are_maps_without_memory():
    r = run(windy(), "deadzone", D=4.0, c=51.0)
    far = np.abs(r["op"] - 51.0) - 2.0
    assert np.allclose(r["mv"], 51.0 + np.sign(r["op"] - 51.0) * np.maximum(far, 0.0))
    assert np.any(far < 0.0)
    r = run(windy(), "valve_characteristic", R=20.0)
    assert np.allclose(r["mv"], 100.0 * (20.0 ** (r["op"] / 100.0) - 1.0) / 19.0)


def test_valve_lag_is_first_order_from_op_to_mv():
    r = run(windy(), "valve_lag", tau=5.0)
    keep = math.exp(-1.0 / 5.0)
    assert np.allclose(r["mv"][1:], keep * r["mv"][:-1] + (1.0 - keep) * r["op"][1:])


# --- process


@pytest.mark.parametrize(
    ("effect", "parameters", "true"),
    [
        ("gain_mismatch", {"factor": 1.7}, {"K": 0.8 * 1.7}),
        ("time_constant_mismatch", {"factor": 0.4}, {"T": 4.8}),
        ("dead_time_mismatch", {"extra": 3.15}, {"Td": 5.45}),
        ("dead_time_mismatch", {"extra": -9.0}, {"Td": 0.0}),
        ("extra_lag", {"tau": 4.0}, {"lags": (4.0,)}),
    ],
)
def test_process_effects_show_in_the_step_response(effect, parameters, true):
    case = still(a_case(setpoint={"kind": "constant", "value": 40.0}, warm=50))
    rig = build(case, [{"effect": effect, "parameters": parameters}])
    rig.changes.append(("step", lambda rng, t, rows: rows["load"].__iadd__(t >= 0.0)))
    model = {"K": 0.8, "T": 12.0, "Td": 2.3, "lags": ()} | true
    truth = [40.0 + TWIN["step_response"](float(k), "foptd", **model) for k in range(case["n"])]
    assert np.allclose(rig.record(1)["pv"], truth, atol=1e-8)


def test_nominal_runs_on_the_baselines_plant():
    case = a_case()
    case["nominal"] = case["plant"] | {"K": 1.0, "T": 9.0}
    other = a_case()
    other["plant"] = dict(case["nominal"])
    assert np.array_equal(
        build(case, [], nominal=True).record(1)["pv"], build(other, []).record(1)["pv"]
    )


# --- sensor


def test_noise_adds_white_noise_in_quadrature():
    change, _ = rows(windy(n=40_000), "noise", factor=2.0, std=0.4)
    added = change["noise"]
    assert np.std(added) == pytest.approx(math.sqrt(3.0 * 0.3**2 + 0.4**2), rel=0.02)
    assert abs(np.mean(added[1:] * added[:-1])) < 0.02 * np.var(added)
    quieter, _ = build(windy(), [{"effect": "noise", "parameters": {"factor": 0.5}}]).rows(1)
    assert np.allclose(quieter["noise"], 0.5 * build(windy(), []).rows(1)[0]["noise"])


def test_quantisation_in_the_loop_and_in_the_record():
    healthy = run(windy())
    loop_, record = (
        run(windy(), "quantisation", step=0.7, at="loop"),
        run(windy(), "quantisation", step=0.7, at="record"),
    )
    for r in (loop_, record):
        assert np.allclose(r["pv"] / 0.7, np.round(r["pv"] / 0.7), atol=1e-9)
    assert np.array_equal(record["op"], healthy["op"])
    assert not np.array_equal(loop_["op"], healthy["op"])
    assert np.array_equal(record["pv"], np.round(healthy["pv"] / 0.7) * 0.7)


def test_sensor_lag_filters_the_noisy_pv():
    case = still(windy(setpoint={"kind": "constant", "value": 40.0}))
    raw, filtered = run(case)["pv"], run(case, "sensor_lag", tau=6.0)["pv"]
    keep = math.exp(-1.0 / 6.0)
    twin = lfilter([1.0 - keep], [1.0, -keep], raw - 40.0) + 40.0
    assert np.allclose(filtered[200:], twin[200:], atol=1e-6)


def test_compression_touches_the_record_only_and_misses_no_sample_by_more_than_its_band():
    healthy, r = run(windy()), run(windy(), "compression", band=0.5)
    assert np.array_equal(healthy["op"], r["op"])
    assert np.max(np.abs(healthy["pv"] - r["pv"])) <= 0.5 + 1e-9
    assert np.mean(np.abs(np.diff(r["pv"], 2)) < 1e-9) > 0.5


def test_outliers_strike_single_samples():
    healthy, r = run(windy()), run(windy(), "outliers", rate=0.03, size=5.0, at="record")
    off = r["pv"] - healthy["pv"]
    hit = off != 0.0
    assert 10 <= np.count_nonzero(hit) <= 45
    assert not np.any(hit[1:] & hit[:-1])
    assert np.mean(np.abs(off[hit])) == pytest.approx(5.0, rel=0.1)
    assert np.array_equal(healthy["op"], r["op"])
    assert not np.array_equal(
        healthy["op"], run(windy(), "outliers", rate=0.03, size=5.0, at="loop")["op"]
    )


@pytest.mark.parametrize(("effect", "row"), [("drift", "wander"), ("load_drift", "load")])
def test_drifts_are_ramps_and_walks_that_begin_with_the_record(effect, row):
    case = a_case(n=30_000, Ts=2.0)
    ramp, t = rows(case, effect, rate=-0.02)
    assert np.allclose(ramp[row], -0.02 * t)
    walk, t = rows(case, effect, walk=0.5)
    assert walk[row][t == 0.0] == 0.0
    assert np.std(np.diff(walk[row])) == pytest.approx(0.5 * math.sqrt(2.0), rel=0.02)


# --- disturbance


def test_oscillation_is_a_sine_at_the_plants_input():
    change, t = rows(a_case(), "oscillation", amplitude=3.0, period=37.0)
    sine = np.column_stack([np.sin(2 * math.pi * t / 37.0), np.cos(2 * math.pi * t / 37.0)])
    found, left, *_ = np.linalg.lstsq(sine, change["load"], rcond=None)
    assert np.hypot(*found) == pytest.approx(3.0)
    assert float(left[0]) < 1e-12


def test_load_steps_have_their_rate_and_their_size():
    change, _ = rows(a_case(n=200_000, Ts=0.5), "load_steps", rate=0.04, size=2.5)
    jumps = np.diff(change["load"]) != 0.0
    assert np.mean(jumps) / 0.5 == pytest.approx(0.04, rel=0.05)
    assert np.std(change["load"]) == pytest.approx(2.5, rel=0.06)


# --- controller


@pytest.mark.parametrize("product", PRODUCTS)
def test_saturation_limits_op_and_is_left_without_windup(product):
    case = a_case(product)
    case["setpoint"]["moves"] = [[100.0, 100.0, 47.0], [450.0, 450.0, 40.0]]
    r = run(case, "saturation", lo=45.0, hi=53.0)
    assert r["op"].min() >= 45.0
    assert r["op"].max() == 53.0
    if product != "bias_p":
        assert np.all(r["op"][300:450] == 53.0)
    assert np.all(r["op"][455:] < 53.0)


def test_detuning_scales_the_tuning():
    case = a_case()
    twin = deepcopy(case)
    twin["controller"] |= {"Kc": 1.1 * 0.6, "Ti": 14.0 * 1.5}
    assert np.array_equal(
        run(case, "detuning", Kc_factor=0.6, Ti_factor=1.5)["op"], run(twin)["op"]
    )


def test_error_within_the_deadband_counts_as_none():
    r = run(windy(), "error_deadband", width=2.0)
    e = r["sp"] - r["pv"]
    e = np.where(np.abs(e) <= 1.0, 0.0, e)
    moves = 1.1 * (np.diff(e) + e[1:] / 14.0)
    assert np.allclose(np.diff(r["op"]), moves, atol=1e-9)
    assert np.mean(np.diff(r["op"]) == 0.0) > 0.2


def test_op_quantisation_reaches_valve_and_record():
    r = run(windy(), "op_quantisation", step=0.37)
    assert np.allclose(r["op"] / 0.37, np.round(r["op"] / 0.37), atol=1e-9)
    assert np.array_equal(r["mv"], r["op"])


# --- foreign kinds


def test_scans_that_are_missed_hold_op():
    case = windy()
    rig = build(
        case,
        [{"effect": "scan_overrun", "parameters": {"share": 0.5, "length": 80.0, "scans": 5.0}}],
    )
    mode = rig.rows(1)[0]["mode"][case["warm"] :]
    r = rig.record(1)
    assert set(np.unique(mode)) == {0, 3}
    assert np.all(np.diff(r["op"])[mode[1:] == 3] == 0.0)
    assert np.all(np.diff(r["op"])[mode[1:] == 0] != 0.0)


def test_feedforward_of_gain_1_all_but_cancels_the_load():
    case = windy(noise=NOISE | {"std": 0.0}, setpoint={"kind": "constant", "value": 40.0})
    assert np.std(run(case, "steam_feedforward", gain=1.0)["pv"]) < 0.05 * np.std(run(case)["pv"])


def test_manual_spells_hold_op_but_for_the_operators_hand_and_end_without_a_bump():
    case = windy(n=4000)
    rig = build(case, [{"effect": "manual_spells", "parameters": {"share": 0.4, "length": 60.0}}])
    mode = rig.rows(1)[0]["mode"][case["warm"] :]
    assert np.mean(mode > 0) == pytest.approx(0.4, abs=0.12)
    moves = np.abs(np.diff(rig.record(1)["op"]))
    assert np.all(moves[mode[1:] == 1] == 0.0)
    assert np.any(moves[mode[1:] == 2] > 0.0)
    back = (mode[1:] == 0) & (mode[:-1] == 1)
    assert np.median(moves[back]) < 3.0 * np.median(moves[mode[1:] == 0])


def test_valve_faults_bound_the_stem():
    r = run(windy(), "stroke_speed", rate=0.2)
    assert np.max(np.abs(np.diff(r["mv"]))) <= 0.2 + 1e-12
    r = run(windy(), "travel_stop", lo=49.0, hi=51.0)
    assert np.array_equal(r["mv"], np.clip(r["op"], 49.0, 51.0))
    assert r["op"].max() > 51.5


def test_ringing_positioner_overshoots_as_its_damping_says():
    case = still(a_case(warm=50, Ts=0.1))
    rig = build(
        case, [{"effect": "positioner_ringing", "parameters": {"period": 10.0, "damping": 0.2}}]
    )
    rig.changes.append(("step", lambda rng, t, rows: rows["forward"].__iadd__(t >= 0.0)))
    mv = rig.record(1)["mv"] - 50.0
    assert mv.max() == pytest.approx(
        1.0 + math.exp(-math.pi * 0.2 / math.sqrt(1.0 - 0.04)), abs=0.01
    )
    assert mv[-1] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("shrink_swell", {"lead": 6.0}),
        ("header_resonance", {"period": 20.0, "damping": 0.1}),
        ("white_water_recycle", {"share": 0.6, "delay": 40.0}),
    ],
)
def test_process_faults_keep_the_gain_and_change_the_way_there(effect, parameters):
    case = still(a_case(warm=50, n=1500, setpoint={"kind": "constant", "value": 40.0}))
    rig = build(case, [{"effect": effect, "parameters": parameters}])
    rig.changes.append(("step", lambda rng, t, rows: rows["load"].__iadd__(t >= 0.0)))
    pv = rig.record(1)["pv"] - 40.0
    assert pv[-1] == pytest.approx(0.8, abs=1e-3)
    if effect == "shrink_swell":
        assert pv[:12].min() < -0.1
    elif effect == "header_resonance":
        turns = np.count_nonzero(np.diff(np.sign(np.diff(pv[5:200]))))
        assert 16 <= turns <= 21  # two a period
    else:
        first = [0.4 * TWIN["step_response"](float(k), "foptd", 0.8, 12.0, 2.3) for k in range(40)]
        assert np.allclose(pv[:40], first, atol=1e-9)


def test_titration_has_slope_1_at_the_set_point_and_bends():
    case = still(a_case(warm=50, setpoint={"kind": "constant", "value": 40.0}))
    for shape, sign in ((1.0, -1.0), (-1.0, 1.0)):
        rig = build(case, [{"effect": "titration", "parameters": {"width": 2.0, "shape": shape}}])
        rig.changes.append(
            ("ramp", lambda rng, t, rows: rows["load"].__iadd__(np.clip(0.05 * t, 0.0, None)))
        )
        straight = build(case, [])
        straight.changes = rig.changes
        bent, y = rig.record(1)["pv"] - 40.0, straight.record(1)["pv"] - 40.0
        near, far = (y > 0.02) & (y < 0.2), y > 3.0
        assert np.allclose(bent[near], y[near], rtol=0.01)
        assert np.all(sign * (bent[far] - y[far]) > 0.3)


@pytest.mark.parametrize(
    ("effect", "parameters", "share"),
    [
        ("frozen_spells", {"share": 0.3, "length": 25.0}, 0.3),
        ("scanner_hold", {"cycle": 20.0, "held": 0.25}, 0.25),
    ],
)
def test_held_measurements_repeat_and_the_controller_sees_it(effect, parameters, share):
    case = windy(n=5000)
    r = run(case, effect, **parameters)
    assert np.mean(np.diff(r["pv"]) == 0.0) == pytest.approx(share, abs=0.08)
    e = r["sp"] - r["pv"]
    assert np.allclose(np.diff(r["op"]), 1.1 * (np.diff(e) + e[1:] / 14.0), atol=1e-9)


def test_air_only_ever_lowers_pv():
    change, _ = rows(windy(), "entrained_air", rate=0.02, depth=4.0, length=6.0)
    assert change["wander"].max() == 0.0
    assert change["wander"].min() < -2.0


def test_backwash_is_rectangular_and_regular():
    change, _ = rows(a_case(n=4000), "backwash_pulses", height=5.0, period=200.0, duty=0.1)
    assert set(np.round(np.unique(change["load"]), 9)) == {-5.0, 0.0}
    starts = np.flatnonzero(np.diff(change["load"]) < 0.0)
    assert set(np.diff(starts)) == {200}


def test_surge_strikes_pv_itself():
    change, _ = rows(
        a_case(n=4000), "surge_bursts", amplitude=3.0, period=12.0, cycles=6.0, rate=0.002
    )
    assert np.all(change["load"] == 0.0)
    assert 1.0 < np.max(np.abs(change["upset"])) < 9.0
    assert abs(np.mean(change["upset"])) < 0.05


def test_a_case_survives_json():
    case = draw_loop(np.random.default_rng(5))
    again = json.loads(json.dumps(case))
    assert np.array_equal(run(case)["pv"], run(again)["pv"])


def test_kernel_takes_what_the_rig_gives_it_without_compiling_anew():
    """One signature for all loops: a second one would cost seconds in every process."""
    for number in range(12):
        run(draw_loop(np.random.default_rng(number)))
    assert len(loop._run.signatures) == 1
    assert discretise(a_case()["plant"], 1.0).delay == 2
    assert set(RULES) == {"forward", "backward", "trapezoidal"}
