"""A stated loop gives the same record, bit for bit, whatever numpy and BLAS choose for the
processor.
"""

import json
import sys

import pytest

from simbench.bench.execute.compute_piece import record_hash
from simbench.loop.disturbance import DISTURBANCES
from simbench.loop.simulate import simulate
from tests.common.plain_loops import chaotic_loop as sticky
from tests.common.processors import OLDER, PROCESSORS, on

CHAOTIC = 8
FIRST = 9  # samples


def loops():
    """Return loops by name: chaotic ones, and one for every load and every kind of plant."""
    for k in range(CHAOTIC):
        yield f"chaotic {k}", sticky(valve={"model": "choudhury", "S": 4.0 + k, "J": 1.0 + k / 5})
    for kind in DISTURBANCES:
        more = {"jitter": 0.3} if kind in ("sine", "propagated") else {}
        load = {"type": kind, "amplitude": 1.0, "period": 70.0, **more}
        yield kind, sticky(disturbance=[load])
    for kind in ("smooth", "harmonics", "propagated"):
        load = {"type": "echo", "valve": "choudhury", "S": 5.0, "J": 1.5, "kind": kind}
        yield f"echo {kind}", sticky(disturbance=[load], valve={"model": "ideal"})
    for den in ([30.0, 11.0, 1.0], [30.0, 4.0, 1.0], [60.0, 52.0, 13.0, 1.0], [10.0, 1.0, 0.0]):
        plant = {"type": "tf", "num": [0.05 if den[-1] == 0.0 else 1.3], "den": den, "Td": 2.2}
        yield f"den {den}", sticky(plant=plant, controller={"type": "PI", "Kc": 0.7, "Ti": 25.0})
    for name, numbers in (
        ("oscillation", {"amplitude": 2.0, "period": 40.0}),
        ("load_steps", {"rate": 0.01, "size": 1.0}),
        ("sensor_lag", {"tau": 4.0}),
        ("extra_lag", {"tau": 4.0}),
    ):
        yield f"effect {name}", sticky(effect=[{"name": name, **numbers}])


def hashes():
    found = {}
    for name, loop in loops():
        record = simulate(loop, 7).record
        found[name] = record_hash(record.window(0, FIRST)), record_hash(record)
    return found


@pytest.mark.parametrize("name", [*PROCESSORS, *OLDER])
def test_a_stated_loop_gives_the_same_bits_on_every_processor(name):
    said = on({**PROCESSORS, **OLDER}[name], "-m", __name__)
    assert said.returncode == 0, said.stderr
    assert {k: tuple(v) for k, v in json.loads(said.stdout).items()} == hashes()


if __name__ == "__main__":
    json.dump(hashes(), sys.stdout)
