"""The loop that the confirmation tests work on."""

import pytest

from simbench.scenarios.spec import Loop


def make(S=5.0, J=2.0, Kc=1.0, kind="foptd", K=1.0, noise=0.0, Ts=1.0, n=1500, **more):
    """Build a PI loop with a choudhury valve."""
    plant = {"type": kind, "K": K, "Td": 2.0} | ({"T": 10.0} if kind == "foptd" else {})
    controller = {"type": "PI", "Kc": Kc, "Ti": 10.0, "direction": "reverse" if K > 0 else "direct"}
    valve = {"model": "choudhury", "S": S, "J": J}
    table = {"plant": plant, "controller": controller, "valve": valve, "noise": {"std": noise}}
    return Loop.from_table({**table, "sampling": {"Ts": Ts, "n": n}, **more})


@pytest.fixture
def loop():
    return make
