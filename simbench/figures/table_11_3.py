"""Table 11.3: which loops a sticky valve keeps cycling: as printed, by theory, reached by load
steps, and in simulations.

Each cell is a grid of tunings and valves; a simulated loop counts when any of six starts leaves the
valve cycling. Where count and table differ the table is too coarse: a self-regulating P loop cycles
if K Kc J > S, and a dead-band cycles under tight PI.
"""

from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from simbench.figures._loops import choudhury, pi_loop
from simbench.figures._marks import table
from simbench.loop.simulate import simulate
from simbench.page.style import styled
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import phase_crossings
from simbench.theory.table_check import check_table_11_3
from simbench.theory.tables import DEAD_BAND, STICK_SLIP, TABLE_11_3

SOURCE = "Jelali (2013), Table 11.3, after Choudhury et al. (2008)"
S = 5.0
T = 10.0
Ts = 0.5
DELAYS = (2.0, 5.0, 20.0)
SHARES = (0.2, 0.5, 0.8)
INTEGRALS = (0.5, 1.0, 2.0)
JUMPS = (0.2, 0.5, 1.0, 1.5)
LOADS = (4.0, 2.0, 7.5, 5.5)  # steps (%)
STEPS = (8.0, 3.0)  # of the set point, which move OP by about so many %


def ultimate_gain(K: float, T: float | None, Td: float, Ti: float | None) -> float:
    """Return the Kc (% per PV unit) at which the loop with the continuous plant would oscillate
    without a valve's help; without T the plant integrates.
    """
    w = np.geomspace(1e-3, 1e2, 20001)
    s = 1j * w
    if T is None:
        lag = s
    else:
        lag = T * s + 1
    L = K * np.exp(-Td * s) / lag * (1.0 if Ti is None else 1 + 1 / (Ti * s))
    past = phase_crossings(L)
    if past.size:
        return float(1 / np.abs(L[past[-1]]))
    return np.nan


def loops(process: str, controller: str, nonlinearity: str) -> list[Loop]:
    """Return the grid of one cell."""
    # The slip jumps of the cell
    grid_of_cell = []
    if nonlinearity == DEAD_BAND:
        ratios = (0.0,)
    else:
        ratios = JUMPS

    # Every dead time, gain and integral time of the cell
    for Td, share, integral, ratio in product(
        DELAYS, SHARES, INTEGRALS if controller == "PI" else (None,), ratios
    ):
        if process == "self-regulating":
            plant = {"K": 1.0, "T": T}
        else:
            plant = {"K": 0.1, "T": None}
        # integral time over T, or for the integrating plant over ten dead times
        if integral is None:
            Ti = None
        else:
            Ti = integral * (plant["T"] or 10 * Td)
        Kc = share * ultimate_gain(**plant, Td=Td, Ti=Ti)
        if np.isfinite(Kc):
            grid_of_cell.append(
                pi_loop(
                    **plant,
                    Td=Td,
                    Kc=Kc,
                    Ti=Ti,
                    Ts=Ts,
                    n=24000,
                    valve=choudhury(S, ratio * S),
                )
            )
    return grid_of_cell


def cycles(loop: Loop) -> bool:
    """Whether any start leaves the valve moving to and fro at the end, without decay."""
    # Starts by load steps and by steps of the set point
    n = loop.sampling.n
    least = 0.5 * float(str(loop.valve.parameters["J"])) or 0.05 * S
    per_percent = abs(loop.plant.K) * (1.0 if loop.plant.type == "foptd" else loop.plant.Td)
    begun = [loop.model_copy(update={"disturbance": (load_step(size),)}) for size in LOADS]
    for size in STEPS:
        begun.append(
            loop.with_("setpoint.steps", [[0.0, loop.setpoint.value + size * per_percent]])
        )

    # A start that still moves at the end, and has not decayed, is a cycle
    for start in begun:
        mv = simulate(start).record.mv
        early = np.ptp(mv[n // 2 : 3 * n // 4])
        late = np.ptp(mv[3 * n // 4 :])
        moves = np.diff(mv[3 * n // 4 :])
        turns = np.count_nonzero(np.diff(np.sign(moves[moves != 0])))
        if late > least and late > 0.8 * early and turns >= 2:
            return True
    return False


def load_step(size: float) -> Part:
    """Return a load at the plant's input that steps to `size` (%) and stays."""
    return Part(name="ramp", parameters={"amplitude": size, "period": Ts, "at": "input"})


def data() -> pd.DataFrame:
    """Count the cycling loops of every cell.

    Columns: process, controller, nonlinearity, table ("limit cycles" or "no limit cycles"); on the
    grid of the theory: loops, exist, reached (by any of 25 random load steps), disagreements
    (against the table, each with its condition); on this figure's grid of simulations: cycled,
    simulated.
    """
    rows = []
    for check in check_table_11_3():
        key = check.process, check.controller, check.nonlinearity
        grid = loops(*key)
        printed = "limit cycles" if TABLE_11_3[key] else "no limit cycles"
        why = "; ".join(f"{n} x {condition}" for condition, n in check.disagreements.items())
        counts = check.loops, check.exist, check.reached, why
        rows.append(list(key) + [printed] + list(counts) + [sum(map(cycles, grid)), len(grid)])
    names = (
        "process controller nonlinearity table loops exist reached disagreements cycled simulated"
    )
    return pd.DataFrame(rows, columns=names.split())


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the table with a count in every cell."""
    # A row for every plant and controller
    rows = []
    for process, controller in dict.fromkeys(zip(data["process"], data["controller"])):
        part = data[(data["process"] == process) & (data["controller"] == controller)]
        cells = {}
        for r in part.to_dict("records"):
            cells[r["nonlinearity"]] = _cell_text(r)
        rows.append([process, controller, cells[DEAD_BAND], cells[STICK_SLIP]])
    frame = pd.DataFrame(
        rows, columns=["process", "controller", "dead-band (J = 0)", "stick-slip (J > 0)"]
    )

    # What the three lines mean
    foot = (
        "First line: the table. Then: loops in which the exact cycle exists; those that any of 25"
        " random load steps reaches; simulated loops that cycle from at least one of six starts."
        " Self-regulating P with stick-slip cycles if and only if K Kc J > S; a dead-band under PI"
        " only where Kc is near its limit."
    )
    return table(frame, [16, 11, 26, 26], foot=foot)


def _cell_text(row: dict) -> str:
    return (
        f"{row['table']}\nexists in {row['exist']} of {row['loops']}\nreached in {row['reached']}"
        f" of {row['loops']}\ncycled in {row['cycled']} of {row['simulated']}"
    )
