"""Plants given by num and den, PID, and parts by a user's law."""

import control
import numpy as np
import pytest

import simbench as sb
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

PI = {"type": "PI", "Kc": 1, "Ti": 10}
BASE = {
    "plant": {"type": "foptd", "K": 1.5, "T": 10, "Td": 2.3},
    "controller": PI,
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "sampling": {"Ts": 1, "n": 600},
    "noise": {"std": 0.1},
    "setpoint": {"steps": [[10, 55]]},
}
PLANTS = {
    "second order": {"type": "tf", "num": [1.5], "den": [50, 15, 1], "Td": 2.3},
    "underdamped": {"type": "tf", "num": [1.5], "den": [100, 6, 1], "Td": 2.0},
    "inverse response": {"type": "tf", "num": [-3.0, 1.5], "den": [50, 15, 1], "Td": 0.4},
    "third order": {"type": "tf", "num": [1.5], "den": [500, 150, 20, 1]},
    "integrator with lag": {"type": "tf", "num": [0.1], "den": [4, 1, 0], "Td": 1},
    "tank": {"type": "tank", "K": 1.5, "T": 10, "Td": 2.3},
}
PID = {"type": "PID", "Kc": 0.5, "Ti": 10, "Td": 2, "b": 0.7}
CONTROLLERS = {
    "PI": PI,
    **{
        f"{form}, {windup}": {**PID, "form": form, "anti_windup": windup}
        for form in ("positional", "velocity")
        for windup in ("clamping", "back-calculation")
    },
    "scheduled": {**PID, "schedule": [[48, 0.5], [54, 1.5]], "schedule_on": "op"},
    "error squared": {"type": "error_squared", "Kc": 1, "Ti": 10, "width": 2},
}


def loop(**sections):
    return Loop.from_table({**BASE, **sections})


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_a_first_order_plant_written_as_tf_has_the_bits_of_foptd(factor):
    expected = simulate(loop(), 1)
    same = simulate(
        loop(plant={"type": "tf", "num": [1.5 * factor], "den": [10 * factor, factor], "Td": 2.3}),
        1,
    )
    assert np.array_equal(expected.record.pv, same.record.pv)
    assert np.array_equal(expected.record.op, same.record.op)


def test_an_integrator_written_as_tf_has_the_bits_of_integrating():
    expected = simulate(loop(plant={"type": "integrating", "K": 0.1, "Td": 1}), 1)
    assert np.array_equal(
        expected.record.pv,
        simulate(loop(plant={"type": "tf", "num": [0.1], "den": [1, 0], "Td": 1}), 1).record.pv,
    )
    assert expected.record.process == "integrating"


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    "law", ["PI", pytest.param("velocity, back-calculation", marks=pytest.mark.slow)]
)
def test_compiled_plants_are_their_plain_twins(plant, law):
    _same_as_twin(loop(plant=PLANTS[plant], controller=CONTROLLERS[law]))


@pytest.mark.parametrize("law", CONTROLLERS)
def test_compiled_controllers_are_their_plain_twins(law):
    _same_as_twin(loop(controller=CONTROLLERS[law]))


def _same_as_twin(one):
    fast, slow = (run_setup(resolve_loop(one, 1), kick=1.0, plain=plain) for plain in (False, True))
    assert np.array_equal(fast.record.pv, slow.record.pv)
    assert np.array_equal(fast.record.op, slow.record.op)
    assert np.ptp(fast.mv) > 1.0


@pytest.mark.parametrize(
    "sections",
    [*({"plant": p} for p in PLANTS.values()), *({"controller": c} for c in CONTROLLERS.values())],
)
def test_a_loop_is_what_its_own_file_says(sections):
    one = loop(**sections)
    assert Loop.from_table(one.to_table()) == one
    assert Loop.model_validate_json(one.model_dump_json()) == one


def test_pid_without_derivative_and_limits_is_pi():
    linear = loop(valve={"model": "ideal"})
    expected = simulate(linear, 1).record
    for form in ("positional", "velocity"):
        pid = simulate(
            loop(
                controller={"type": "PID", "Kc": 1, "Ti": 10, "form": form},
                valve={"model": "ideal"},
            ),
            1,
        ).record
        assert np.abs(pid.pv - expected.pv).max() < 1e-9


@pytest.mark.parametrize(
    "law", [name for name in CONTROLLERS if "clamping" in name or "back" in name]
)
def test_a_controller_at_its_limit_comes_back_at_once(law):
    far = loop(
        controller=CONTROLLERS[law],
        valve={"model": "ideal"},
        noise={},
        setpoint={"steps": [[10, 200], [300, 50]]},
    )
    record = simulate(far).record
    assert record.op[290] > 95.0  # clamping waits a step of its integral below the limit
    assert (record.op[302:310] < 90.0).all()


def test_a_schedule_changes_the_gain_where_it_says():
    steps = {"steps": [[10, 50.5]]}
    quiet = loop(controller={**PID, "b": 1.0}, valve={"model": "ideal"}, noise={}, setpoint=steps)
    twice = quiet.with_("controller.schedule", [[50.2, 1.0], [50.3, 2.0]]).with_(
        "controller.schedule_on", "sp"
    )
    first = [float(simulate(one).record.op[10] - 50.0) for one in (quiet, twice)]
    assert first[1] == pytest.approx(2.0 * first[0], rel=1e-12)


@pytest.mark.parametrize("system", [control.tf, lambda num, den: control.ss(control.tf(num, den))])
def test_a_system_of_python_control_is_a_plant(system):
    expected = sb.Loop(
        plant=system([1.5], [50, 15, 1]), **{k: v for k, v in BASE.items() if k != "plant"}
    )
    written = loop(plant={"type": "tf", "num": [1.5], "den": [50, 15, 1]})
    # to the first move of the valve: beyond it the last bits of the way through a state space grow
    first = int(np.argmax(np.abs(np.diff(simulate(written, 1).mv)) > 0)) + 5
    assert np.allclose(
        expected.simulate(1).record.pv[:first], simulate(written, 1).record.pv[:first], rtol=1e-9
    )
