"""Plants and controllers stated by num and den in powers of z."""

import tomllib

import control
import numpy as np
import pandas as pd
import pytest

import simbench as sb
from simbench.bench.execute.run import run_grid
from simbench.gap import diagnose
from simbench.loop.plant import first_order_like
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import make_grid
from simbench.scenarios.spec import Loop

KC, TI = 0.8, 10.0
BASE = {
    "plant": {"type": "tf", "num": [1.5], "den": [50.0, 15.0, 1.0], "Td": 2.0},
    "controller": {"type": "PI", "Kc": KC, "Ti": TI},
    "sampling": {"Ts": 1.0, "n": 400},
    "noise": {"std": 0.1},
    "setpoint": {"steps": [[10, 55], [200, -30]]},
}
LAW = {"type": "tf", "num": [KC * (1 + 1 / TI), -KC], "den": [1.0, -1.0], "dt": 1.0}
STICKY = {"model": "choudhury", "S": 5.0, "J": 2.0}


def in_z(plant: dict) -> dict:
    """The plant's table in powers of z, by python-control."""
    g = control.c2d(control.tf(plant["num"], plant["den"]), 1.0, "zoh")
    num, den = ([float(x) for x in side[0][0]] for side in (g.num, g.den))
    return {"type": "tf", "num": num, "den": den, "dt": 1.0, "Td": plant.get("Td", 0.0)}


def whole(**changes) -> Loop:
    return Loop.from_table({**BASE, "plant": in_z(BASE["plant"]), "controller": LAW, **changes})


def test_a_loop_in_z_moves_as_the_loop_in_s_that_it_samples_limits_of_op_included():
    one, other = simulate(Loop.from_table(BASE), 3).record, simulate(whole(), 3).record
    assert other.op.min() == 0.0, "the last set point is out of reach: OP rests at its limit"
    np.testing.assert_allclose(other.op, one.op, atol=1e-9)
    np.testing.assert_allclose(other.pv, one.pv, atol=1e-9)


def test_compiled_and_plain_give_the_same_bits():
    setups = [resolve_loop(whole(valve=STICKY), 3) for _ in range(2)]
    fast, slow = (run_setup(s, plain=p) for s, p in zip(setups, (False, True), strict=True))
    for name in ("op", "pv", "mv"):
        assert np.array_equal(getattr(fast.record, name), getattr(slow.record, name))


def test_a_law_with_a_filter_answers_as_python_control_computes_it():
    law = {"type": "tf", "num": [0.5, 0.2, -0.3], "den": [1.0, -1.6, 0.6], "dt": 1.0}
    # a gain so small that the loop is open, and an error that is the set point
    loop = whole(
        plant={"type": "tf", "num": [1e-12], "den": [1.0, -0.5], "dt": 1.0},
        controller=law, noise={}, setpoint={"value": 50, "steps": [[5, 51]]},
        sampling={"Ts": 1.0, "n": 40},
    )  # fmt: skip
    op = simulate(loop).record.op - 50.0
    error = np.where(np.arange(40) >= 5, 1.0, 0.0)
    expected = control.forced_response(
        control.tf(law["num"], law["den"], 1.0), np.arange(40.0), error
    ).outputs
    np.testing.assert_allclose(op, np.clip(expected, -50, 50), atol=1e-9)


def test_it_survives_writing_and_its_gain_and_times_follow():
    loop = whole()
    assert Loop.from_table(tomllib.loads(loop.to_toml())) == loop
    like, of_s = first_order_like(loop.plant), first_order_like(Loop.from_table(BASE).plant)
    assert like.K == pytest.approx(1.5)
    assert (like.T, like.Td) == pytest.approx((of_s.T, of_s.Td), rel=0.01)
    vessel = in_z({"num": [0.5], "den": [1.0, 0.0], "Td": 2.0})
    plant = whole(plant=vessel).plant
    assert plant.integrating
    assert first_order_like(plant).model_dump(exclude_none=True) == pytest.approx(
        {"type": "integrating", "K": 0.5, "Td": 2.0}
    )


def test_a_discrete_system_of_python_control_is_a_plant():
    g = control.c2d(control.tf([1.5], [50, 15, 1]), 1.0, "zoh")
    loop = sb.Loop(**{**BASE, "plant": g})
    plain = sb.Loop(**{**BASE, "plant": {**BASE["plant"], "Td": 0.0}})
    assert loop.plant.dt == 1.0
    np.testing.assert_allclose(loop.simulate(2).record.pv, plain.simulate(2).record.pv, atol=1e-9)


def test_what_has_no_meaning_of_it_says_so_and_the_rest_works(tmp_path):
    loop = whole(valve=STICKY)
    assert "its plant is stated in powers of z" in sb.predict(loop)["reason"]
    with pytest.raises(SpecError, match="no model is fitted; one in s is needed"):
        diagnose(simulate(loop, 1).record, loop)
    tight = loop.with_("effect", [{"name": "detuning", "Kc_factor": 2.0}])
    assert np.ptp(simulate(tight, 1).record.op) > np.ptp(simulate(loop, 1).record.op)
    table = {"title": "z", "loop": loop.to_table(), "axes": {"valve.S": [3.0, 5.0]}}
    run = run_grid(make_grid(table, "z"), tmp_path / "run", ["he"])
    assert pd.read_parquet(run / "scenarios.parquet").error.isna().all()
