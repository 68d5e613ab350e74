"""The simulator on the exact cycle of an integrating loop gain, L(s) = k e^(-Td s)/s."""

from itertools import pairwise

import numpy as np
import pytest

from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.theory.cycle import cycle_start


@pytest.mark.parametrize(
    ("integrating", "K", "Kc", "S", "J", "period", "amplitude"),
    [
        (False, 1.0, 1.0, 5.0, 2.0, 94.4, 2.6111),
        (False, 1.0, 1.0, 5.0, 5.0, 40.4, 2.7778),
        (False, 1.0, 1.0, 5.0, 7.0, 30.1143, 2.8889),
        (True, 0.1, 2.0, 5.0, 5.0, 20.8, 3.125),
    ],
)
def test_simulated_cycle_equals_the_closed_form(integrating, K, Kc, S, J, period, amplitude):
    Ts = 0.02
    plant = (
        {"type": "integrating", "K": K, "Td": 2}
        if integrating
        else {"type": "foptd", "K": K, "T": 10, "Td": 2}
    )
    controller = {"type": "P", "Kc": Kc} if integrating else {"type": "PI", "Kc": Kc, "Ti": 10}
    table = {
        "plant": plant,
        "controller": controller,
        "valve": {"model": "choudhury", "S": S, "J": J},
    }
    loop = Loop.from_table({**table, "sampling": {"Ts": Ts, "n": int(61 * period / Ts)}})
    record = simulate(loop, start=cycle_start(loop)).record
    op, mv = record.op[int(40 * period / Ts) :], record.mv[int(40 * period / Ts) :]
    # the valve jumps upwards once per period
    up = np.nonzero((mv[1:] - mv[:-1]) > 0.5 * J)[0]
    assert len(up) >= 20
    assert Ts * (up[20] - up[0]) / 20 == pytest.approx(period, rel=2e-3)
    swings = [np.ptp(op[a:b]) / 2 for a, b in pairwise(up)]
    assert np.mean(swings) == pytest.approx(amplitude, rel=5e-3)
