"""Loops that several tests of the theory use."""

import pytest

from simbench.scenarios.spec import Loop

PLAIN = {
    "K": 1.0,
    "T": 10.0,
    "Td": 2.0,
    "Kc": 1.0,
    "Ti": 10.0,
    "S": 5.0,
    "J": 2.0,
    "Ts": 0.02,
    "n": 4000,
}


def make(kind="foptd", **changes):
    """Build a choudhury loop; Ti = None is P control. Other changes are whole tables."""
    more = {name: table for name, table in changes.items() if name not in PLAIN}
    K, T, Td, Kc, Ti, S, J, Ts, n = (changes.get(name, PLAIN[name]) for name in PLAIN)
    plant = {"type": kind, "K": K, "Td": Td} | ({"T": T} if kind == "foptd" else {})
    controller = {"type": "P", "Kc": Kc} if Ti is None else {"type": "PI", "Kc": Kc, "Ti": Ti}
    valve = {"model": "choudhury", "S": S, "J": J}
    table = {
        "plant": plant,
        "controller": controller,
        "valve": valve,
        "sampling": {"Ts": Ts, "n": n},
    }
    return Loop.from_table(table | more)


@pytest.fixture
def loop():
    return make
