"""The menu: tests sized for a loop, simulated as a person would do them, and kept within limits."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import Refusal
from simbench.gap.planning.menu import LEAD, Limits, size_test
from simbench.scenarios.errors import SpecError
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml_table import checked

LOOP = Loop.from_table({
    "plant": {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 0.5, "Ti": 10.0},
    "sampling": {"Ts": 1.0, "n": 800},
    "operating_point": {"op0": 50.0, "pv0": 30.0},
    "setpoint": {"value": 30.0},
})  # fmt: skip


def situation():
    rng = np.random.default_rng(0)
    return SimpleNamespace(
        data=SimpleNamespace(K=2.0, T=10.0, Td=2.0), baseline=LOOP, integrating=False,
        op=50 + 2 * rng.standard_normal(800), sp=np.full(800, 30.0),
        record=SimpleNamespace(Ts=1.0, n=800, pv=30 + rng.standard_normal(800)),
    )  # fmt: skip


@pytest.mark.parametrize("id_", ["bump", "stairs"])
def test_in_manual_op_is_the_operators_and_pv_answers_through_the_plant(id_):
    trial = size_test(id_, situation(), {"none": LOOP}, 0.0, Limits())
    record = trial.run(LOOP, 0)
    np.testing.assert_allclose(record.op[LEAD:], 50.0 + trial.moves[LEAD:], atol=1e-6)
    # held until settled, PV has moved by K d
    assert trial.pv_excursion == pytest.approx(2.0 * trial.op_travel, rel=0.05)
    assert trial.minutes == pytest.approx(trial.n / 60.0)


def test_a_set_point_step_moves_pv_by_its_size_and_half_the_gain_is_half():
    trial = size_test("sp_steps", situation(), {"none": LOOP}, 0.0, Limits())
    assert trial.pv_excursion == pytest.approx(trial.size, rel=0.3)
    assert trial.settings["test"] == {"id": "sp_steps", "size": trial.size, "hold_s": trial.hold_s}
    # the controller moves OP, by about what the step needs
    assert trial.op_travel == pytest.approx(trial.size / 2.0, rel=0.7)
    half = size_test("kc_half", situation(), {"none": LOOP}, 0.0, Limits())
    assert half.settings["controller"] == {"Kc_ratio": 0.5}


def test_stairs_are_finer_than_the_friction_they_look_for():
    trial = size_test("stairs", situation(), {"none": LOOP}, 1.0, Limits())
    assert trial.size == pytest.approx(0.4)


@pytest.mark.parametrize("id_", ["bump", "sp_steps", "stairs"])
@pytest.mark.parametrize("most", [0.5, 2.0, 5.0])
def test_no_test_leaves_its_limits(id_, most):
    trial = size_test(
        id_, situation(), {"none": LOOP}, 0.0, Limits(pv_excursion=most, op_travel=3.0)
    )
    if isinstance(trial, Refusal):
        assert id_ in trial.reason
    else:
        assert trial.pv_excursion <= most
        assert trial.op_travel <= 3.0 + 1e-9


@pytest.mark.parametrize("id_", ["bump", "sp_steps", "stairs", "still"])
def test_another_load_takes_no_test_out_of_its_limits(id_):
    load = {"type": "coloured", "amplitude": 1.0, "period": 30.0}
    loop = Loop.from_table(LOOP.to_table() | {"disturbance": [load], "noise": {"std": 0.2}})
    limits = Limits(pv=(0.0, 60.0), op=(20.0, 80.0), pv_excursion=15.0, op_travel=10.0)
    trial = size_test(id_, situation(), {"none": loop}, 0.0, limits)
    runs = [trial.run(loop, 100 + seed) for seed in range(20)]
    assert max(np.abs(r.pv - 30.0).max() for r in runs) <= limits.pv_excursion
    assert all(limits.op[0] <= r.op.min() and r.op.max() <= limits.op[1] for r in runs)


def test_a_test_that_would_last_too_long_is_left_out_and_a_passive_one_is_cut():
    limits = Limits(minutes=5.0)
    refused = size_test("stairs", situation(), {"none": LOOP}, 0.0, limits)
    assert "more than the 5 allowed" in refused.reason
    trial = size_test("mv", situation(), {"none": LOOP}, 0.0, limits)
    assert trial.minutes == pytest.approx(5.0)


def test_limits_are_read_from_a_table():
    limits = checked(Limits, {"pv": [10, 20.0], "minutes": 30}, "limits.toml")
    assert limits == Limits(pv=(10.0, 20.0), minutes=30.0)
    assert limits.op == (0.0, 100.0)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"minute": 3}, "did you mean 'minutes'?"),
        ({"minutes": -1}, "minutes = -1; input should be greater than 0"),
        ({"pv": [3.0, 1.0]}, "[3.0, 1.0] is no range"),
        ({"pv": 3.0}, "[lo, hi] with lo below hi"),
    ],
)
def test_limits_that_cannot_be_meant_are_refused(table, message):
    with pytest.raises(SpecError) as error:
        checked(Limits, table, "limits.toml")
    assert message in str(error.value)
