"""Two loops that many tests simulate, and what a plant would have recorded of them."""

from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

FLOW = {
    "plant": {"type": "foptd", "K": 1.5, "T": 20, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 18},
    "sampling": {"Ts": 1.0, "n": 1500},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50, "steps": [[60, 53], [700, 48]]},
}
LOADED = FLOW | {"disturbance": [{"type": "coloured", "amplitude": 0.6, "period": 30.0}]}
# SP at rest: it moves by its load, or by a valve that sticks
RESTING = {
    "plant": {"type": "foptd", "K": 1.0, "T": 30.0, "Td": 3.0},
    "controller": {"type": "PI", "Kc": 1.2, "Ti": 20.0},
    "noise": {"std": 0.05},
    "disturbance": [{"type": "coloured", "amplitude": 0.3, "period": 20.0}],
    "sampling": {"Ts": 2.0, "n": 1500},
}
# under a load that is quick, for the loop
LOADED_FAST = {
    "plant": {"type": "foptd", "K": 1.0, "T": 30.0, "Td": 6.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 30.0},
    "noise": {"std": 0.05},
    "disturbance": [{"type": "coloured", "amplitude": 0.3, "period": 15.0}],
    "sampling": {"Ts": 2.0, "n": 1500},
}
STICKY = {"valve": {"model": "choudhury", "S": 6.0, "J": 4.0}}


def recorded(table, *effects, seed=2, **changes):
    """Return the record of a loop with some effects, each (name, parameters), and other
    sections.
    """
    acting = {"effect": [{"name": n, **p} for n, p in effects]} if effects else {}
    return simulate(Loop.from_table({**table, **changes, **acting}), seed).record


def resting(seed, n=1500, **changes):
    """Return OP, PV and SP of the resting loop; a kick starts what other sections, such as a sticky
    valve, make of it.
    """
    table = {**RESTING, "sampling": {"Ts": 2.0, "n": n}, **changes}
    return simulate(Loop.from_table(table), seed, kick=5.0 if changes else 0.0).record.without_mv()
