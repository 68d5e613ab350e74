"""The mill's parts against slow twins and textbook cases, and its effects on cases that can be
checked by hand.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from results.studies.worlds.mill import archive, controller, loop, nature, valve
from results.studies.worlds.mill.controller import PRODUCTS
from results.studies.worlds.mill.effects import build
from results.studies.worlds.mill.foreign import KINDS
from results.studies.worlds.mill.loops import draw_loop
from simbench.detectors.compiled import compiled
from simbench.detectors.errors import ParameterError, UnknownName


def step_response(t, kind, K, T, Td, lags=()):
    """PV at time t after the input has stepped by 1 at time 0, by partial fractions (distinct time
    constants).
    """
    s = t - Td
    if s <= 0.0:
        return 0.0
    if kind == "integrating":
        return K * (s - sum(tau * (1.0 - math.exp(-s / tau)) for tau in lags))
    taus = [T, *lags]
    return K - K * sum(
        math.exp(-s / a) * math.prod(a / (a - b) for b in taus if b is not a) for a in taus
    )


class PlainController:
    """Each product's law as its manual would say it."""

    def __init__(self, product, tuning, Ts, u0, limits=(0.0, 100.0), tracking=1.0):
        self.law, self.rule, self.Ts = product.law, product.rule, Ts
        self.Kc, self.Ti = tuning
        self.lo, self.hi = limits
        self.integral, self.last_e, self.last_u = u0, 0.0, u0
        self.track = None if self.Ti is None else min(1.0, Ts / (tracking * self.Ti))

    def limit(self, u):
        return min(max(u, self.lo), self.hi)

    def __call__(self, e):
        self.last_u, self.last_e = self.moved(e), e
        return self.last_u

    def moved(self, e):
        if self.law == controller.PROPORTIONAL:
            return self.limit(self.integral + self.Kc * e)
        means = {"forward": self.last_e, "backward": e, "trapezoidal": (e + self.last_e) / 2}
        push = self.Kc * self.Ts / self.Ti * means[self.rule]
        if self.law == controller.VELOCITY:
            return self.limit(self.last_u + self.Kc * (e - self.last_e) + push)
        grown = self.integral + push
        wanted = self.Kc * e + grown
        if self.law == controller.CONDITIONAL:
            outward = (wanted > self.hi and push > 0.0) or (wanted < self.lo and push < 0.0)
            self.integral = self.integral if outward else grown
            return self.limit(self.Kc * e + self.integral)
        if self.law == controller.TRACKING:
            self.integral = grown - self.track * (wanted - self.limit(wanted))
            return self.limit(wanted)
        self.integral = self.limit(grown)
        return self.limit(self.Kc * e + self.integral)


def a_case(product="velocity_backward", kind="foptd", **changes):
    """A plain loop without load, noise or archive; what a test wants otherwise comes by keyword."""
    plant = {"type": kind, "K": 0.8, "T": 12.0, "Td": 2.3, "lags": []}
    tuning = {"product": product, "direction": "reverse", "Kc": 1.1, "Ti": 14.0}
    tuning |= {"tracking": 0.5, "resolution": 0.0}
    if kind == "integrating":
        del plant["T"]
        plant["K"], tuning["Ti"] = 0.06, 40.0
    if product == "bias_p":
        del tuning["Ti"]
    moves = [[100.0, 100.0, 44.0], [450.0, 450.0, 38.0]]
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
        "setpoint": {"kind": "steps", "value": 40.0, "moves": moves},
        "archive": {"pv": [], "op": [], "mv": [], "sp": [], "op_late": False},
    }
    return case | changes


LOAD = {"kind": "wander", "pace": 30.0, "std": 2.0, "mean": 0.0}
NOISE = {"kind": "white", "shape": 0.0, "std": 0.3, "flow": 0.0}
CONSTANT = {"kind": "constant", "value": 40.0}


def windy(**changes):
    return a_case(**{"load": LOAD, "noise": NOISE, **changes})


def rig(case, effect=None, **parameters):
    return build(case, [{"effect": effect, "parameters": parameters}] if effect else [])


def run(case, effect=None, **parameters):
    return rig(case, effect, **parameters).record(1)


def change(case, effect, **parameters):
    """What an effect adds to the signals from outside, and the times."""
    before, _ = rig(case).rows(1)
    after, t = rig(case, effect, **parameters).rows(1)
    return {k: after[k].astype(float) - before[k] for k in after}, t


def still(case):
    """The same loop with the controller's hands tied: OP rests at op0."""
    return case | {"controller": case["controller"] | {"Kc": 1e-12, "Ti": 1e6}}


def after_step(case, effect, **parameters):
    """The record after a unit step of the load."""
    stepped = rig(case, effect, **parameters)
    stepped.changes.append(("step", lambda rng, t, rows: rows["load"].__iadd__(t >= 0.0)))
    return stepped.record(1)


@pytest.mark.parametrize("product", PRODUCTS)
@pytest.mark.parametrize("kind", ["foptd", "integrating"])
def test_loop_agrees_with_sums_of_step_responses_and_plain_controllers(product, kind):
    case = a_case(product, kind, n=150, warm=1, load=LOAD)
    case["setpoint"]["moves"] = [[20.0, 20.0, 52.0], [90.0, 90.0, 38.0]]
    ours = run(case, "saturation", lo=47.0, hi=58.0)
    signals, _ = rig(case).rows(1)
    plant, tuning = case["plant"], case["controller"]
    plc = PlainController(
        PRODUCTS[product], (tuning["Kc"], tuning.get("Ti")), 1.0, 50.0, (47.0, 58.0), 0.5
    )
    response = [step_response(float(k), kind, plant["K"], plant.get("T"), 2.3) for k in range(152)]
    pv, op, inputs = [], [], [0.0]
    for sp, load in zip(signals["sp"], signals["load"]):
        changes = np.diff(inputs)
        pv.append(40.0 + np.dot(changes, response[len(changes) : 0 : -1]))
        op.append(plc(sp - pv[-1]))
        inputs.append(op[-1] - 50.0 + load)
    assert (min(op), max(op)) == (47.0, 58.0)
    assert np.allclose(ours["pv"], pv[1:], atol=1e-8)
    assert np.allclose(ours["op"], op[1:], atol=1e-8)


def positions(model, op, S, J):
    state = np.zeros(valve.STATES)
    state[0] = state[2] = op[0]
    fs, fd = valve.friction_numbers(S, J)
    return np.array([valve.friction(valve.FRICTION[model][0], u, state, fs, fd) for u in op])


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


def test_archives_keep_their_promise():
    digits = archive.significant(np.array([0.0, 1.23456, -98765.0, 0.00123456]), 3)
    assert digits.tolist() == [0.0, 1.23, -98800.0, 0.00123]
    mean = archive.archived(np.array([1.0, 3.0, 4.0]), [{"stage": "average"}], 0)
    assert mean.tolist() == [1.0, 2.0, 3.5]
    x = np.cumsum(np.random.default_rng(5).standard_normal(2000))
    for band in (0.1, 5.0):
        assert np.max(np.abs(x - archive.swinging_door(x, band))) <= band + 1e-9
        sent = np.flatnonzero(x == archive.archived(x, [{"stage": "exception", "band": band}], 0))
        assert {0, len(x) - 1} <= set(sent)
    assert np.count_nonzero(np.abs(np.diff(archive.swinging_door(x, 5.0), 2)) > 1e-9) < 200
    assert np.array_equal(archive.swinging_door(x, 0.0), x)


@pytest.mark.parametrize("kind", [k for k in nature.LOADS if k != "none"])
def test_loads_have_mean_0_and_standard_deviation_1(kind):
    x = np.array([nature.load(kind, 20.0, 20_000, np.random.default_rng(i)) for i in range(8)])
    assert abs(x.mean()) < 0.1
    assert np.sqrt(np.mean(x**2)) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("kind", "shape"), [("white", 0.0), ("ar1", 0.6), ("heavy", 5.0), ("flow", 0.0)]
)
def test_noises_have_standard_deviation_1_and_one_mark_each(kind, shape):
    x = nature.noise(kind, shape, 200_000, np.random.default_rng(7))
    assert np.std(x) == pytest.approx(1.0, abs=0.03)
    assert np.mean(x[1:] * x[:-1]) == pytest.approx(0.6 if kind == "ar1" else 0.0, abs=0.02)
    assert (np.mean(x**4) > 4.0) == (kind == "heavy")


def test_set_point_plans():
    t = np.arange(-5.0, 20.0)
    sp = nature.set_point({"value": 10.0, "moves": [[0.0, 0.0, 12.0], [5.0, 10.0, 9.0]]}, t)
    assert [sp[t == x][0] for x in (-1, 0, 7, 19)] == pytest.approx([10.0, 12.0, 10.8, 9.0])
    plan = {"value": 10.0, "tau": 20.0, "std": 2.0, "seed": 1}
    wander = nature.set_point(plan, np.arange(100_000.0))
    assert np.std(wander) == pytest.approx(2.0, rel=0.1)
    assert np.std(np.diff(wander)) == pytest.approx(2.0 / 20.0, rel=0.1)


@pytest.mark.parametrize("name", KINDS)
def test_at_identity_a_foreign_kind_changes_no_bit(name):
    healthy, same = run(windy()), run(windy(), name, **KINDS[name].identity)
    assert all(np.array_equal(healthy[k], same[k]) for k in healthy)


@pytest.mark.parametrize(
    ("case", "effects", "error", "word"),
    [
        ({}, [("stiktion", {})], UnknownName, "stiction"),
        ({}, [("stiction", {"Q": 1.0})], UnknownName, "Q"),
        ({}, [("stiction", {"S": -1.0})], ParameterError, "0 to 100 % of travel"),
        ({}, [("quantisation", {"step": 1.0, "at": "plant"})], ParameterError, "loop, record"),
        ({}, [("stiction", {"S": 1.0}), ("deadzone", {"D": 2.0})], ParameterError, "another fric"),
        ({"known_band": 0.5}, [("stiction", {"S": 1.0, "J": 0.5})], ParameterError, "dead-band"),
        ({"kind": "integrating"}, [("time_constant_mismatch", {"factor": 2.0})], ParameterError,
         "foptd"),
        ({}, [("saturation", {"lo": 60.0, "hi": 40.0})], ParameterError, "not below"),
    ],
)  # fmt: skip
def test_what_cannot_act_is_refused_in_one_sentence(case, effects, error, word):
    with pytest.raises(error, match=word):
        build(a_case(**case), [{"effect": e, "parameters": p} for e, p in effects])


def test_valve_effects_lie_between_op_and_mv():
    r = run(windy(known_band=0.8), "deadband", S=2.2)  # adds to the known band
    v = r["mv"][0]
    for u, moved in zip(r["op"][1:], r["mv"][1:]):
        v = max(u - 1.5, min(u + 1.5, v))
        assert moved == pytest.approx(v, abs=1e-9)
    r = run(windy(), "deadzone", D=4.0, c=51.0)
    far = np.abs(r["op"] - 51.0) - 2.0
    assert np.allclose(r["mv"], 51.0 + np.sign(r["op"] - 51.0) * np.maximum(far, 0.0))
    assert np.any(far < 0.0)
    r = run(windy(), "valve_characteristic", R=20.0)
    assert np.allclose(r["mv"], 100.0 * (20.0 ** (r["op"] / 100.0) - 1.0) / 19.0)
    r = run(windy(), "valve_lag", tau=5.0)
    keep = math.exp(-1.0 / 5.0)
    assert np.allclose(r["mv"][1:], keep * r["mv"][:-1] + (1.0 - keep) * r["op"][1:])
    r = run(windy(), "op_quantisation", step=0.37)
    assert np.allclose(r["op"] / 0.37, np.round(r["op"] / 0.37), atol=1e-9)
    assert np.array_equal(r["mv"], r["op"])


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
    case = still(a_case(setpoint=CONSTANT, warm=50))
    model = {"K": 0.8, "T": 12.0, "Td": 2.3, "lags": ()} | true
    truth = [40.0 + step_response(float(k), "foptd", **model) for k in range(case["n"])]
    assert np.allclose(after_step(case, effect, **parameters)["pv"], truth, atol=1e-8)


def test_noise_adds_white_noise_in_quadrature():
    added = change(windy(n=40_000), "noise", factor=2.0, std=0.4)[0]["noise"]
    assert np.std(added) == pytest.approx(math.sqrt(3.0 * 0.3**2 + 0.4**2), rel=0.02)
    assert abs(np.mean(added[1:] * added[:-1])) < 0.02 * np.var(added)


def test_quantisation_compression_and_outliers_in_the_loop_and_in_the_record():
    healthy = run(windy())
    for effect, p in (("quantisation", {"step": 0.7}), ("outliers", {"rate": 0.03, "size": 5.0})):
        in_loop, in_record = (run(windy(), effect, at=at, **p) for at in ("loop", "record"))
        assert not np.array_equal(in_loop["op"], healthy["op"])
        assert np.array_equal(in_record["op"], healthy["op"])
        if effect == "quantisation":
            assert np.allclose(in_loop["pv"] / 0.7, np.round(in_loop["pv"] / 0.7), atol=1e-9)
            assert np.array_equal(in_record["pv"], np.round(healthy["pv"] / 0.7) * 0.7)
    off = in_record["pv"] - healthy["pv"]
    assert 10 <= np.count_nonzero(off) <= 45
    assert np.mean(np.abs(off[off != 0.0])) == pytest.approx(5.0, rel=0.1)
    r = run(windy(), "compression", band=0.5)
    assert np.array_equal(healthy["op"], r["op"])
    assert np.max(np.abs(healthy["pv"] - r["pv"])) <= 0.5 + 1e-9
    assert np.mean(np.abs(np.diff(r["pv"], 2)) < 1e-9) > 0.5


@pytest.mark.parametrize(("effect", "row"), [("drift", "wander"), ("load_drift", "load")])
def test_drifts_are_ramps_and_walks_that_begin_with_the_record(effect, row):
    case = a_case(n=30_000, Ts=2.0)
    ramp, t = change(case, effect, rate=-0.02)
    assert np.allclose(ramp[row], -0.02 * t)
    walk, t = change(case, effect, walk=0.5)
    assert walk[row][t == 0.0] == 0.0
    assert np.std(np.diff(walk[row])) == pytest.approx(0.5 * math.sqrt(2.0), rel=0.02)


def test_loads_oscillate_and_step_as_they_are_asked_to():
    added, t = change(a_case(), "oscillation", amplitude=3.0, period=37.0)
    sine = np.column_stack([np.sin(2 * math.pi * t / 37.0), np.cos(2 * math.pi * t / 37.0)])
    sizes, rest, *_ = np.linalg.lstsq(sine, added["load"], rcond=None)
    assert np.hypot(*sizes) == pytest.approx(3.0)
    assert float(rest[0]) < 1e-12
    added, _ = change(a_case(n=50_000, Ts=0.5), "load_steps", rate=0.04, size=2.5)
    assert np.mean(np.diff(added["load"]) != 0.0) / 0.5 == pytest.approx(0.04, rel=0.1)
    assert np.std(added["load"]) == pytest.approx(2.5, rel=0.1)


def test_detuning_scales_the_tuning_and_a_deadband_takes_small_errors_away():
    twin = a_case()
    twin["controller"] |= {"Kc": 1.1 * 0.6, "Ti": 14.0 * 1.5}
    detuned = run(a_case(), "detuning", Kc_factor=0.6, Ti_factor=1.5)
    assert np.array_equal(detuned["op"], run(twin)["op"])
    r = run(windy(), "error_deadband", width=2.0)
    e = r["sp"] - r["pv"]
    e = np.where(np.abs(e) <= 1.0, 0.0, e)
    assert np.allclose(np.diff(r["op"]), 1.1 * (np.diff(e) + e[1:] / 14.0), atol=1e-9)
    assert np.mean(np.diff(r["op"]) == 0.0) > 0.2


def test_manual_spells_hold_op_but_for_the_operators_hand_and_end_without_a_bump():
    case = windy(n=4000)
    spells = rig(case, "manual_spells", share=0.4, length=60.0)
    mode = spells.rows(1)[0]["mode"][case["warm"] :]
    assert np.mean(mode > 0) == pytest.approx(0.4, abs=0.12)
    moves = np.abs(np.diff(spells.record(1)["op"]))
    assert np.all(moves[mode[1:] == 1] == 0.0)
    assert np.any(moves[mode[1:] == 2] > 0.0)
    back = (mode[1:] == 0) & (mode[:-1] == 1)
    assert np.median(moves[back]) < 3.0 * np.median(moves[mode[1:] == 0])


@pytest.mark.parametrize(
    ("effect", "parameters"),
    [
        ("shrink_swell", {"lead": 6.0}),
        ("header_resonance", {"period": 20.0, "damping": 0.1}),
        ("white_water_recycle", {"share": 0.6, "delay": 40.0}),
    ],
)
def test_process_faults_keep_the_gain_and_change_the_way_there(effect, parameters):
    case = still(a_case(warm=50, n=1500, setpoint=CONSTANT))
    pv = after_step(case, effect, **parameters)["pv"] - 40.0
    assert pv[-1] == pytest.approx(0.8, abs=1e-3)
    if effect == "shrink_swell":
        assert pv[:12].min() < -0.1
    elif effect == "header_resonance":
        turns = np.count_nonzero(np.diff(np.sign(np.diff(pv[5:200]))))
        assert 16 <= turns <= 21  # two a period
    else:
        first = [0.4 * step_response(float(k), "foptd", 0.8, 12.0, 2.3) for k in range(40)]
        assert np.allclose(pv[:40], first, atol=1e-9)


@pytest.mark.parametrize(
    ("effect", "parameters", "share"),
    [
        ("frozen_spells", {"share": 0.3, "length": 25.0}, 0.3),
        ("scanner_hold", {"cycle": 20.0, "held": 0.25}, 0.25),
    ],
)
def test_held_measurements_repeat_and_the_controller_sees_it(effect, parameters, share):
    r = run(windy(n=5000), effect, **parameters)
    assert np.mean(np.diff(r["pv"]) == 0.0) == pytest.approx(share, abs=0.08)
    e = r["sp"] - r["pv"]
    assert np.allclose(np.diff(r["op"]), 1.1 * (np.diff(e) + e[1:] / 14.0), atol=1e-9)


def test_kernel_takes_what_the_rig_gives_it_without_compiling_anew():
    """One signature for all loops: a second one would cost seconds in every process."""
    for number in range(6):
        run(draw_loop(np.random.default_rng(number)))
    assert len(compiled(loop._run).signatures) == 1
