"""Plain loops that many tests simulate: settings of `example_loop`, and a chaotic one."""

from simbench.scenarios.spec import Loop

DELAYED = {"T": 3.0, "Td": 6.0, "Kc": 0.25, "Ti": 3.0}
LEVEL = {"process": "integrating", "K": 0.1, "Td": 1.0, "Kc": 1.5, "Ti": 30.0}
CHAOTIC = {
    "plant": {"type": "foptd", "K": 1.3, "T": 17.0, "Td": 3.3},
    "controller": {"type": "PI", "Kc": 1.1, "Ti": 17.0},
    "valve": {"model": "choudhury", "S": 5.0, "J": 1.5},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.05},
    "setpoint": {"value": 50.0, "steps": [[0.0, 54.0]]},
}


def chaotic_loop(**changes):
    """A sticky loop in which a last bit soon makes another record."""
    return Loop.from_table({**CHAOTIC, **changes})
