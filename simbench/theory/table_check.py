"""Table 11.3 against theory: in each of its eight cells, how many loops have a cycle, and how often
a load step reaches it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from simbench.scenarios.spec import Loop
from simbench.theory.basin import reaches_cycle
from simbench.theory.cycle import after_load_step, exact_cycle
from simbench.theory.sampled import SampledLoop, sampled_loop, ultimate_gain
from simbench.theory.tables import CONDITIONS, DEAD_BAND, TABLE_11_3, refined

_BAND_S = 5.0
_SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the ultimate gain
_UNLIMITED = 8.0  # K Kc (integrating: K Kc T) in its place without dead time
_JUMPS = (0.2, 0.5, 1.0, 1.5)  # J/S
_LARGEST_LOAD = 6.0  # %


@dataclass(frozen=True)
class _CellCheck:
    """One cell of Table 11.3 against theory."""

    # process, controller, nonlinearity: the cell
    process: str
    controller: str
    nonlinearity: str
    table: bool  # whether the table says limit cycle
    loops: int  # tunings, dead times and jumps tried
    exist: int  # loops with a limit cycle (exact theory)
    conditions_right: int  # loops of which the refined condition says so rightly
    reached: int  # loops that at least one of the random load steps brought into the cycle
    disagreements: dict[str, int]  # condition -> loops on which theory contradicts the table's word


def check_table_11_3(*, load_steps: int = 25, seed: int = 0, every: int = 1) -> list[_CellCheck]:
    """Verify the eight cells of Table 11.3.

    600 loops: three dead times (one of them 0), five gains of 0.1..0.9 of the ultimate gain, three
    integral times, four J/S; S = 5 %. Load steps act on a loop at rest in mid-band, without noise.
    """
    # Cell by cell of the table
    rng = np.random.default_rng(seed)
    checks = []
    for key, table in TABLE_11_3.items():
        exist = right = reached = 0
        differ: Counter[str] = Counter()
        loops = list(_loops_of_cell(*key))[::every]

        # Whether the exact cycle exists, and theory agrees with it
        for loop in loops:
            cycle = exact_cycle(loop)
            right += refined(loop, cycle) == (cycle is not None)
            if (cycle is not None) != table:
                differ[_condition_of_key(key, cycle is not None)] += 1

            # Whether random steps of the load reach it
            if cycle is None:
                continue
            exist += 1
            steps = rng.uniform(-_LARGEST_LOAD, _LARGEST_LOAD, load_steps)
            reached += any(
                reaches_cycle(loop, cycle, after_load_step(loop, step)) for step in steps
            )
        checks.append(_CellCheck(*key, table, len(loops), exist, right, reached, dict(differ)))
    return checks


def _condition_of_key(key: tuple[str, str, str], exists: bool) -> str:
    if key in CONDITIONS:
        return CONDITIONS[key]
    return "a cycle exists against the table" if exists else "no start kept cycling"


def _loops_of_cell(process: str, controller: str, nonlinearity: str) -> Iterator[SampledLoop]:
    # Plants with and without dead time
    integrating = process == "integrating"
    if integrating:
        plant: dict[str, Any] = {"type": "integrating", "K": 0.1}
    else:
        plant = {"type": "foptd", "K": 1.0, "T": 10.0}
    for Td in (0.0, 1.0, 4.0) if integrating else (0.0, 2.0, 10.0):
        # Controllers with and without integral action
        for Ti in (
            ((10.0, 20.0, 40.0) if integrating else (5.0, 10.0, 20.0))
            if controller == "PI"
            else (None,)
        ):
            table: dict[str, Any] = {
                "plant": {**plant, "Td": Td},
                "controller": {"type": "P", "Kc": 1.0}
                if Ti is None
                else {"type": "PI", "Kc": 1.0, "Ti": Ti},
                "valve": {"model": "choudhury", "S": _BAND_S, "J": 0.0},
                "sampling": {"Ts": 0.1},
            }

            # Gains as shares of the ultimate one, and slip jumps
            if Td:
                limit = ultimate_gain(sampled_loop(Loop.from_table(table)))
            else:
                limit = None
            for share in _SHARES:
                for jump in (0.0,) if nonlinearity == DEAD_BAND else _JUMPS:
                    table["controller"]["Kc"] = share * (limit or _UNLIMITED)
                    table["valve"]["J"] = jump * _BAND_S
                    yield sampled_loop(Loop.from_table(table))
