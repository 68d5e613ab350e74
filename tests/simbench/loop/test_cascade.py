"""A loop whose set point is another loop's OP: both records, sampled exactly."""

import control
import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import simbench as sb
from simbench.cli import app
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.simulate import simulate, simulate_batch
from simbench.scenarios.spec import Loop

TABLE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 3.0, "Td": 0.7},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 3},
    "valve": {"model": "choudhury", "S": 6, "J": 3},
    "sampling": {"Ts": 0.5, "n": 600},
    "noise": {"std": 0.05},
    "setpoint": {"value": 50},
    "outer": {
        "plant": {"type": "foptd", "K": 0.8, "T": 30.0, "Td": 4},
        "controller": {"type": "PI", "Kc": 1.5, "Ti": 30},
        "noise": {"std": 0.05},
        "setpoint": {"value": 70, "steps": [[50, 72]]},
    },
}


def test_both_records_are_those_of_the_plain_twin_and_the_outer_op_is_the_inner_set_point():
    fast, slow = (
        run_setup(resolve_loop(Loop.from_table(TABLE), 1), plain=plain) for plain in (False, True)
    )
    for a, b in ((fast.record, slow.record), (fast.outer, slow.outer)):
        assert np.array_equal(a.pv, b.pv)
        assert np.array_equal(a.op, b.op)
    assert np.array_equal(fast.record.sp, fast.outer.op)
    assert np.ptp(fast.outer.sp) == 2.0
    assert np.ptp(fast.mv[-200:]) > 2.0


def test_the_outer_pv_is_what_the_valve_makes_of_both_plants_in_series():
    quiet = {**TABLE, "noise": {}, "outer": {**TABLE["outer"], "noise": {}}}
    run = simulate(Loop.from_table({**quiet, "plant": {**quiet["plant"], "Td": 1.0}}))
    both = control.sample_system(
        control.ss(control.tf([1.2], [3, 1]) * control.tf([0.8], [30, 1])), 0.5, "zoh"
    )
    late = np.concatenate([np.zeros(10), run.mv - 50.0])[: run.mv.size]  # Td = 1 + 4 s
    expected = control.forced_response(both, np.arange(run.mv.size) * 0.5, late).outputs
    assert np.abs(run.outer.pv - 70.0 - expected).max() < 1e-9


def test_the_span_of_set_points_scales_the_outer_op():
    wide = {**TABLE, "outer": {**TABLE["outer"], "sp_span": [0.0, 200.0]}}
    run = simulate(Loop.from_table(wide), 1)
    assert np.allclose(run.record.sp, 2.0 * run.outer.op)
    assert run.outer.op[0] == pytest.approx(25.0, abs=1.0)


def test_a_cascade_is_a_file_a_batch_and_a_verb(tmp_path):
    loop = sb.Loop(**TABLE)
    assert Loop.from_table(loop.to_table()) == Loop.from_table(TABLE)
    (tmp_path / "pair.toml").write_text(loop.to_toml())
    result = CliRunner().invoke(
        app,
        ["simulate", str(tmp_path / "pair.toml"), "-o", str(tmp_path / "FIC.csv"), "--seed", "1"],
    )
    assert result.exit_code == 0
    inner, outer = (pd.read_csv(tmp_path / name) for name in ("FIC.csv", "FIC_outer.csv"))
    assert np.array_equal(inner.sp, outer.op)
    run = simulate_batch([loop], [1])[0]
    assert np.array_equal(run.outer.pv, loop.simulate(1).outer.pv)


def test_theory_says_that_it_cannot_tell():
    prediction = sb.predict(Loop.from_table(TABLE))
    assert prediction["table_11_3"] is None
    assert "cascade" in prediction["reason"]
