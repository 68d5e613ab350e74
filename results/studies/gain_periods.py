"""What does a change of the controller gain do to the period of a loop, with a sound valve and with
one that sticks? `python -m results.studies.gain_periods` simulates both before and after the change
and prints the median ratio of the periods.
"""

from __future__ import annotations

import math
import sys

import pandas as pd

from simbench.confirm.expected import Expected, expect_change
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

NOISE = 0.1  # PV units
LOAD = {"type": "coloured", "amplitude": 0.3, "period": 100.0}  # %, s: it lets a level roll
SIZES = (3.0, 5.0)  # S, %
JUMP = 0.5  # J over S
SAMPLES, TS = 60_000, 1.0  # of each phase; s
LEVEL = {"type": "integrating", "K": 0.0033, "Td": 5.0}
FLOW = {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0}
# plant, controller, factor on Kc
CASES = {
    "level, PI with Ti = 60 s": (LEVEL, {"Kc": 0.35, "Ti": 60.0}, (0.6, 1.5)),
    "level, PI with Ti = 600 s": (LEVEL, {"Kc": 0.35, "Ti": 600.0}, (0.6,)),
    "self-regulating, PI, Kc = 1": (FLOW, {"Kc": 1.0, "Ti": 10.0}, (0.6, 1.5)),
    "self-regulating, PI, Kc = 5.2": (FLOW, {"Kc": 5.2, "Ti": 10.0}, (0.6, 0.8)),
}


def expected(plant: dict, controller: dict, factor: float, sizes: tuple[float, ...]) -> Expected:
    """Return what simulations do whose valve has one of some bands; no band: a sound valve."""
    loop = Loop.from_table(
        {
            "plant": plant,
            "controller": {"type": "PI", **controller},
            "noise": {"std": NOISE},
            "disturbance": [LOAD] if plant is LEVEL else [],
            "sampling": {"Ts": TS, "n": SAMPLES},
        }
    )
    stuck = [
        loop.model_copy(
            update={"valve": Part(name="choudhury", parameters={"S": S, "J": JUMP * S})}
        )
        for S in sizes
    ]
    loops = [(one, 1.0 + max(sizes, default=0.0), (1.0, factor)) for one in stuck or [loop]]
    return expect_change(loops, (SAMPLES, SAMPLES), TS)


def told(found: Expected) -> tuple[str, str]:
    """Return the median ratio of the periods, and how many go on of those that oscillate before
    the change.
    """
    on = sum(math.isfinite(x) for x in found.changes[:, 0])
    return (f"{found.period:.2f}" if on else "-"), f"{on} of {len(found.changes)}"


def table() -> pd.DataFrame:
    """Return one row a loop and factor."""
    rows = []
    for name, (plant, controller, factors) in CASES.items():
        for factor in factors:
            sound = told(expected(plant, controller, factor, ()))
            stuck = told(expected(plant, controller, factor, SIZES))
            rows.append((name, f"{factor:g}", *sound, *stuck))
    return pd.DataFrame(rows, columns=["loop", "Kc times", "sound", "go on", "sticky", "go on"])


def main() -> int:
    """Print the table."""
    print(
        f"S = {SIZES[0]:g} and {SIZES[1]:g} %, J = {JUMP:g} S, noise {NOISE:g}\nperiods after a"
        " change of gain over those before it, and how many go on of those that oscillate before"
    )
    print(table().to_string(index=False))
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(main))
