"""The training set: every effect and foreign kind, of the strength it claims, in loops that a plant could have."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from detectors.errors import ParameterError, UnknownName
from simbench.gap.decide.training import foreign as foreign_kinds
from simbench.gap.decide.training.bench import LOADS, NOISES, _colour, draw_bench, noise, shaped
from simbench.gap.decide.training.draw import STRENGTHS, _apply, _cloud, draw_case
from simbench.gap.decide.training.foreign import FOREIGN, Oddity, foreign_loop
from simbench.gap.decide.training.sizes import scales
from simbench.loop.effects import BLOCKS, EFFECTS


def believable(case):
    r, b, truth = case.record, case.baseline, case.bench.loop
    assert r.sp is not None
    assert all(np.isfinite(x).all() for x in (r.op, r.pv, r.sp))
    assert r.op.min() >= 0.0
    assert r.op.max() <= 100.0
    assert r.n == b.sampling.n
    assert 800 <= r.n <= 4000
    seen = truth.plant.Td - case.bench.late * r.Ts
    for value, true in ((b.plant.K, truth.plant.K), (b.plant.Td, seen), (b.plant.T, truth.plant.T)):
        assert (value is None) == (true is None)
        assert value is None or 0.9 <= value / true <= 1.1
    assert b.noise.std == truth.noise.std > 0
    assert b.controller == truth.controller
    assert b.disturbance == b.effect == ()
    at = [0, *(round(t / r.Ts) for t, _ in b.setpoint.steps), r.n]
    levels = [b.setpoint.value, *(value for _, value in b.setpoint.steps)]
    assert np.allclose(r.sp, np.repeat(levels, np.diff(at)), rtol=1e-4)


@pytest.mark.parametrize(("i", "effect"), list(enumerate(EFFECTS)))
def test_every_effect_can_be_drawn_in_the_strength_asked_for(i, effect):
    strength = list(STRENGTHS)[i % 3]
    case = draw_case(i, (effect,), strength=strength)
    low, high = STRENGTHS[strength]
    assert case.effects == (effect,)
    assert case.strength == strength
    assert low <= case.ratio <= high
    assert set(EFFECTS[effect].parameters) >= set(case.parameters[effect]) - {"model"}
    believable(case)


@pytest.mark.parametrize(("i", "kind"), list(enumerate(FOREIGN)))
def test_every_foreign_kind_can_be_drawn(i, kind):
    case = draw_case(100 + i, foreign=kind)
    low, high = STRENGTHS[case.strength]
    assert low <= case.ratio <= high
    assert case.foreign == kind
    assert case.effects == ()
    assert case.block == FOREIGN[kind].block
    believable(case)


def test_the_ratio_is_that_of_the_record_to_fresh_runs_of_the_loop_without_the_effect():
    case = draw_case(3, ("load_steps",), strength="strong", mv=True)
    cloud = _cloud(case.bench, (987, 1))
    assert cloud is not None
    assert cloud.ratio(case.record) > 2.0
    healthy = draw_case(3)
    cloud = _cloud(healthy.bench, (987, 1))
    assert cloud is not None
    assert cloud.ratio(healthy.record) < 2.0


def test_foreign_kinds_spread_over_all_blocks():
    assert {kind.block for kind in FOREIGN.values()} == set(BLOCKS)
    assert len(FOREIGN) >= 10
    assert not set(FOREIGN) & set(EFFECTS)


def test_same_seed_gives_the_same_bits():
    for effects, kind in (((), ""), (("stiction",), ""), (("noise", "deadband"), ""), ((), "load_bursts")):
        a, b = (draw_case(11, effects, kind, mv=True) for _ in range(2))
        assert a.baseline == b.baseline
        assert a.parameters == b.parameters
        for name in ("op", "pv", "sp", "mv"):
            assert np.array_equal(getattr(a.record, name), getattr(b.record, name))


def test_recording_mv_changes_nothing_else():
    a, b = draw_case(21, ("drift",), mv=True), draw_case(21, ("drift",), mv=False)
    assert b.record.mv is None
    assert a.baseline.plant.type == b.baseline.plant.type
    assert np.array_equal(a.record.pv, b.record.pv)


def test_other_seeds_give_other_loops():
    assert len({draw_case(s).baseline.plant.K for s in range(5)}) == 5


def test_without_effect_strength_is_none_and_chance_explains_the_gap():
    cases = [draw_case(s) for s in range(30)]
    for case in cases:
        assert (case.strength, case.effects, case.foreign, case.parameters) == ("none", (), "", {})
        believable(case)
    assert 0.8 < np.median([case.ratio for case in cases]) < 1.2
    assert {case.record.mv is None for case in cases} == {True, False}
    assert {case.baseline.plant.type for case in cases} == {"foptd", "integrating"}
    assert {case.baseline.controller.type for case in cases} == {"P", "PI"}


def test_two_effects_are_both_there_and_each_at_least_medium():
    case = draw_case(5, ("op_quantisation", "outliers"), mv=False)
    assert list(case.parameters) == ["op_quantisation", "outliers"]
    assert case.strength in ("medium", "strong")
    assert case.record.mv is None
    step = case.parameters["op_quantisation"]["step"]
    assert np.allclose(case.record.op / step, np.round(case.record.op / step), atol=1e-3)


def test_recorded_op_follows_the_stated_tuning_in_the_controllers_form():
    forms, late = set(), set()
    for seed in range(30):
        case = draw_case(seed)
        r, c, form, shift = case.record, case.baseline.controller, case.bench.form, int(case.bench.late)
        e, op = r.e[: r.n - shift], r.op[shift:]
        if c.Ti is None:
            assert np.allclose(op, case.baseline.operating_point.op0 + c.sign * c.Kc * e, atol=c.Kc * 2e-5 * np.abs(r.pv).max())
            continue
        forms.add(form)
        late.add(shift)
        a, b = 1 + (1 - form) * r.Ts / c.Ti, -1 + form * r.Ts / c.Ti
        assert np.allclose(np.diff(op), c.sign * c.Kc * (a * e[1:] + b * e[:-1]), atol=c.Kc * 4e-5 * np.abs(r.pv).max() + 2e-4)
    assert forms == {0.0, 0.5, 1.0}
    assert late == {0, 1}


def test_noise_effect_scales_the_stated_noise_whatever_its_colour():
    bench = replace(draw_bench(np.random.default_rng(4)), noise=("moving average", -0.5))
    setup = bench.setup((1, 2))
    _apply(setup, "noise", {"factor": 3.0}, np.random.default_rng(0))
    added = bench.finish(setup, (1, 2)).pv_add
    assert added.std() == pytest.approx(3 * bench.loop.noise.std, rel=0.1)
    assert np.mean(added[1:] * added[:-1]) < -0.3 * added.var()


def test_loads_and_noises_have_unit_standard_deviation():
    rng = np.random.default_rng(0)
    f = np.fft.rfftfreq(80_000)
    for kind in LOADS:
        x = shaped(rng, 40_000, _colour(kind, f, 15.0, rng))
        assert x.std() == pytest.approx(float(kind != "none"), abs=0.2)
    for kind in NOISES:
        depth = 6.0 if kind == "heavy tails" else 0.5
        assert noise(rng, 40_000, kind, depth).std() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_foreign_loop_without_oddity_is_the_simulator(seed):
    bench = replace(draw_bench(np.random.default_rng(seed), play=False), kick=0.0)
    record = bench.run(bench.finish(bench.setup((1, seed)), (1, seed)))
    odd = Oddity(bench.finish(bench.setup((1, seed)), (1, seed)), scales(bench, record)).run()
    for name in ("op", "pv", "mv"):
        assert np.allclose(getattr(record, name), getattr(odd, name), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", ["hidden_override", "slow_opening", "flow_dead_time", "recycle", "root_sensor"])
def test_compiled_foreign_loop_agrees_with_plain_python(kind, monkeypatch):
    bench = draw_bench(np.random.default_rng(7), foptd=True, steps=True, play=False)

    def run():
        setup = bench.finish(bench.setup((1, 1)), (1, 1))
        own = scales(bench, bench.run(bench.finish(bench.setup((1, 1)), (1, 1))))
        return foreign_kinds.run_foreign(kind, setup, own, 0.8, np.random.default_rng(0))[0]

    fast = run()
    monkeypatch.setattr(foreign_kinds, "foreign_loop", foreign_loop.py_func)
    slow = run()
    assert np.allclose(fast.op, slow.op, atol=1e-6)
    assert np.allclose(fast.pv, slow.pv, rtol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"effects": ("sticktion",)}, UnknownName),
        ({"foreign": "gremlins"}, UnknownName),
        ({"effects": ("noise",), "strength": "huge"}, UnknownName),
        ({"strength": "weak"}, ParameterError),
        ({"effects": ("noise",), "foreign": "recycle"}, ParameterError),
        ({"effects": ("noise", "noise")}, ParameterError),
        ({"effects": ("stiction", "deadband")}, ParameterError),
    ],
)
def test_impossible_wishes_are_refused(wrong, error):
    with pytest.raises(error):
        draw_case(0, **wrong)


def test_training_does_not_know_the_blind_checks_generator():
    code = (
        "import sys; from simbench.gap.decide.training import draw_case; draw_case(1, ('noise',));"
        "print([m for m in sys.modules if m.startswith('simbench.blind')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
