"""The controller's law and the samples: what needs no likelihood."""

import numpy as np
import pytest

from scenarios.spec import Loop
from simbench.gap.law import examine_law
from simbench.gap.samples import inspect_samples
from simbench.loop.simulate import simulate

BASE = {
    "plant": {"type": "foptd", "K": 1.5, "T": 20, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 18},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50, "steps": [[60, 53], [700, 48]]},
    "disturbance": [{"type": "coloured", "amplitude": 0.6, "period": 30.0}],
}


def record(*effects, **changes):
    return simulate(Loop.from_table({**BASE, **changes, "effect": [{"name": n, **p} for n, p in effects]}), seed=2).record


def law(r, Ti=18.0):
    return examine_law(r.op, r.pv, r.sp, r.Ts, 0.6, Ti)


def test_the_law_of_an_untouched_controller_is_exact():
    found = law(record())
    assert found.known
    assert not found.found
    assert found.baseline_residual < 1e-9


def test_detuning_is_measured_to_the_digit():
    p = law(record(("detuning", {"Kc_factor": 1.7, "Ti_factor": 0.6}))).found["detuning"]
    assert p["Kc_factor"] == pytest.approx(1.7, rel=1e-6)
    assert p["Ti_factor"] == pytest.approx(0.6, rel=1e-6)


@pytest.mark.parametrize(("effect", "parameters", "key", "tolerance"), [
    ("error_deadband", {"width": 0.3}, "width", 0.03), ("op_quantisation", {"step": 0.4}, "step", 1e-6),
    ("saturation", {"lo": 0.0, "hi": 52.0}, "hi", 1e-6),
])  # fmt: skip
def test_controller_effects_are_found_with_their_size(effect, parameters, key, tolerance):
    found = law(record((effect, parameters))).found
    assert set(found) == {effect}
    assert found[effect][key] == pytest.approx(parameters[key], abs=tolerance)


def test_a_late_archive_is_no_new_tuning():
    r = record()
    found = examine_law(r.op[1:], r.pv[:-1], r.sp[:-1], r.Ts, 0.6, 18.0)
    early = examine_law(r.op[:-1], r.pv[1:], r.sp[1:], r.Ts, 0.6, 18.0)
    assert {found.lag, early.lag} <= {0, 1}
    assert early.known is False or not early.found
    late = examine_law(np.append(r.op[0], r.op[:-1]), r.pv, r.sp, r.Ts, 0.6, 18.0)
    assert late.known
    assert late.lag == 1
    assert not late.found


def test_the_pv_behind_a_compressed_archive_is_recovered():
    raw, archived = record(), record(("compression", {"band": 0.3}))
    seen = law(archived).seen
    assert seen is not None
    inner = slice(100, None)
    assert np.abs(seen - raw.pv)[inner].max() < 0.05 * np.abs(archived.pv - raw.pv)[inner].max()


def test_a_controller_with_derivative_action_is_foreign():
    r = record()
    e = r.sp - r.pv
    op = 50 + np.cumsum(0.6 * np.diff(e, prepend=e[0]) + 0.6 / 18 * e + 3.0 * np.diff(e, 2, prepend=[e[0], e[0]]))
    found = examine_law(op, r.pv, r.sp, 1.0, 0.6, 18.0)
    assert found.foreign


@pytest.mark.parametrize("step", [0.5, 0.237, 3.3])
def test_a_lattice_is_found_through_decimal_rounding(step):
    rng = np.random.default_rng(1)
    pv, op = np.round(rng.normal(40, 5, 800) / step) * step, rng.normal(50, 5, 800)
    # the other column shows that the file has digits to spare
    assert inspect_samples(np.round(pv, 5), np.round(op, 5)).step == pytest.approx(step, rel=1e-3)


def test_decimal_digits_are_no_lattice():
    pv = np.round(np.random.default_rng(1).normal(40, 5, 800), 3)
    assert inspect_samples(pv).step == 0.0


def test_spikes_are_counted_and_steps_are_not():
    rng = np.random.default_rng(2)
    pv = rng.normal(0, 0.1, 1000)
    pv[500:] += 5.0
    assert inspect_samples(pv).spikes.size == 0
    pv[[100, 300, 800]] += [2.0, -2.0, 3.0]
    assert inspect_samples(pv).spikes.tolist() == [100, 300, 800]


def test_straight_lines_are_seen_in_a_compressed_archive_only():
    assert inspect_samples(np.asarray(record(("compression", {"band": 0.3})).pv)).straight > 0.3
    assert inspect_samples(np.asarray(record().pv)).straight == 0.0
