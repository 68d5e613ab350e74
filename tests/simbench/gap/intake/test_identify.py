"""A baseline from the record alone: plant and tuning fitted again, and what may then be asked."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap.diagnosis import conclude
from simbench.gap.intake.identify import fit_plant, identify
from simbench.loop.simulate import simulate
from simbench.scenarios.plant import Controller, Plant
from simbench.scenarios.spec import Loop

STEPS = [[2.0 * k, 50.0 + (-1) ** i * 4.0] for i, k in enumerate(range(100, 1200, 150))]
TABLE = {
    "plant": {"type": "foptd", "K": 1.4, "T": 30.0, "Td": 8.0},
    "controller": {"type": "PI", "Kc": 0.8, "Ti": 25.0},
    "sampling": {"Ts": 2.0, "n": 1200},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": STEPS},
}


def run(table, **more):
    return replace(simulate(Loop.from_table(table | more), seed=1).record, mv=None)


@pytest.fixture(scope="module", params=[1.0, -1.0], ids=["reverse", "direct"])
def first(request):
    control = TABLE["controller"] | {"direction": "reverse" if request.param > 0 else "direct"}
    record = run(TABLE, plant=TABLE["plant"] | {"K": 1.4 * request.param}, controller=control)
    return record, 1.4 * request.param


def test_a_record_gives_its_loop_back_in_seconds(first):
    record, K = first
    control = Controller(type="PI", Kc=0.8, Ti=25.0, direction="reverse" if K > 0 else "direct")
    loop = identify(replace(record, process="self-regulating"), controller=control)
    assert loop.plant.type == "foptd"
    assert (loop.plant.K, loop.plant.T, loop.plant.Td) == (
        pytest.approx(K, rel=0.05), pytest.approx(30.0, rel=0.1), pytest.approx(8.0, abs=1.0),
    )  # fmt: skip
    assert loop.noise.std == pytest.approx(0.1, rel=0.15)
    assert (loop.sampling.Ts, loop.sampling.n) == (2.0, 1200)


def test_a_settling_plant_is_no_vessel_even_with_a_sticky_valve():
    assert identify(replace(run(TABLE), process=None)).plant.type == "foptd"
    sticky = run(TABLE, valve={"model": "choudhury", "S": 4.0, "J": 2.0})
    assert identify(replace(sticky, process=None)).plant.type == "foptd"


def test_a_proportional_controller_has_no_integral_time():
    record = run(TABLE, controller={"type": "P", "Kc": 0.8})
    control = identify(record, plant=Plant(type="foptd", K=1.4, T=30.0, Td=8.0)).controller
    assert (control.type, control.Ti) == ("P", None)
    assert control.Kc == pytest.approx(0.8, rel=0.02)


def test_where_pv_does_not_answer_op_no_plant_is_made_up():
    rng = np.random.default_rng(0)
    record = replace(run(TABLE), op=np.full(1200, 50.0), pv=rng.standard_normal(1200), tag="FIC1")
    with pytest.raises(RecordError, match="record 'FIC1': no plant can be identified"):
        identify(record, controller=Controller(type="PI", Kc=1.0, Ti=10.0))


DRIVEN = {
    "plant": {"type": "foptd", "K": 3.2, "T": 2.5, "Td": 1.0},
    "controller": {"type": "P", "Kc": 1.0},
    "sampling": {"Ts": 0.07, "n": 600},
    "valve": {"model": "coulomb", "S": 3.1, "J": 3.1},
    "noise": {"std": 0.96},
    "disturbance": [{"type": "sine", "at": "output", "amplitude": 1.6, "period": 9.0}],
}


@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=pytest.mark.slow)])
def test_friction_and_feedback_do_not_turn_a_plant(sign):
    control = {"type": "P", "Kc": 1.0, "direction": "reverse" if sign > 0 else "direct"}
    record = run(DRIVEN, plant=DRIVEN["plant"] | {"K": 3.2 * sign}, controller=control)
    assert fit_plant(record.op, record.pv, False, 0.0)[1].K * sign < 0
    assert fit_plant(record.op, record.pv, False, 0.0, sign)[1].K * sign > 0
    loop = identify(replace(record, process="self-regulating"))
    assert (np.sign(loop.plant.K), loop.controller.direction) == (sign, control["direction"])


def test_op_that_is_moved_by_hand_has_no_controller_and_says_so():
    op = 50.0 + np.repeat(np.random.default_rng(0).normal(size=60), 10)
    pv = np.zeros(op.size)
    for k in range(1, op.size):
        pv[k] = 0.9 * pv[k - 1] + 0.1 * (op[k - 1] - 50.0)
    by_hand = LoopRecord(op=op, pv=np.round(pv, 1), sp=np.zeros(op.size), Ts=1.0, tag="FIC7")
    sentence = "record 'FIC7': no controller can be identified: OP does not answer to PV"
    with pytest.raises(RecordError, match=sentence):
        identify(by_hand)
    assert conclude(by_hand).verdict == "no_decision"
