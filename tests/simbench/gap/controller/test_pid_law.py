"""A PID baseline: its settings explain OP to the digit, others do not."""

import pytest

from scenarios.spec import Loop
from simbench.gap.controller.pid_law import examine_pid
from simbench.loop.simulate import simulate

TABLE = {
    "plant": {"type": "tf", "num": [1.0], "den": [20.0, 9.0, 1.0], "Td": 2.0},
    "controller": {"type": "PID", "Kc": 1.2, "Ti": 9.0, "Td": 1.5},
    "valve": {"model": "choudhury", "S": 5.0, "J": 2.0},
    "noise": {"std": 0.05},
    "sampling": {"Ts": 1.0, "n": 800},
}


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"form": "velocity"},
        {"b": 0.5, "c": 0.3, "N": 5.0},
        {"schedule": [[49.0, 0.7], [51.0, 1.4]]},
        {"anti_windup": "back-calculation"},
    ],
)
def test_settings_explain_the_op_that_they_made_and_no_other(settings):
    loop = Loop.from_table({**TABLE, "controller": TABLE["controller"] | settings})
    r = simulate(loop, kick=5.0).record
    law = examine_pid(r.op, r.pv, r.sp, r.Ts, loop.controller, loop.pv0)
    assert law.known
    assert law.residual < 1e-9
    detuned = loop.controller.model_copy(update={"Td": 4.0})
    assert examine_pid(r.op, r.pv, r.sp, r.Ts, detuned, loop.pv0).reason
