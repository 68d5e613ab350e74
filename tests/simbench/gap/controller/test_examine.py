"""A PID baseline: its settings explain OP to the digit, others do not."""

import numpy as np
import pytest

from simbench.gap.controller.examine import examine_controller
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

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
    law = examine_controller(r.op, r.pv, r.sp, r.Ts, loop)
    assert law.known
    assert law.residual < 1e-9
    detuned = loop.with_("controller.Td", 4.0)
    assert examine_controller(r.op, r.pv, r.sp, r.Ts, detuned).reason


def by_exception(x, band):
    """Return a signal as an archive has it that repeats the last value until it leaves it by more
    than a band.
    """
    kept = x.copy()
    for k in range(1, x.size):
        if abs(x[k] - kept[k - 1]) <= band:
            kept[k] = kept[k - 1]
    return kept


def test_an_archive_that_stores_op_late_or_by_exception_hides_no_settings():
    loop = Loop.from_table({**TABLE, "noise": {"std": 0.3}})
    r = simulate(loop, kick=5.0).record
    about = (r.Ts, loop)
    late = examine_controller(r.op[:-1], r.pv[1:], r.sp[1:], *about)
    assert (late.known, late.late) == (True, 1)
    coarse = examine_controller(by_exception(r.op, 0.3), by_exception(r.pv, 0.3), r.sp, *about)
    assert coarse.known
    # two bands of OP, and what two of PV make of it
    assert coarse.hidden > 0.6
    other = loop.with_("controller.Kc", 6.0)
    retuned = examine_controller(r.op[:-1], r.pv[1:], r.sp[1:], r.Ts, other)
    assert retuned.tuning == pytest.approx((0.2, 1.0))


def test_the_pv_behind_a_pid_is_recovered_from_op():
    table = {**TABLE, "controller": TABLE["controller"] | {"b": 0.4, "N": 5.0}}
    table = {**table, "noise": {"std": 0.1}}
    r = simulate(Loop.from_table(table), seed=3).record
    rounded = np.round(r.pv / 0.3) * 0.3
    law = examine_controller(r.op, rounded, r.sp, r.Ts, Loop.from_table(table))
    assert np.std((law.recovered_pv - r.pv)[20:]) < 0.05 * np.std(rounded - r.pv)
