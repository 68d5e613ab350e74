"""Many loops abreast: the compiled loop of `kernel` for `few()` loops at a time, each with its own numbers.

The same steps in the same order as `simbench.loop.kernel.closed_loop`, so the same bits. The state of every loop stands in a
lane; what a loop decides by itself (does the valve break away?) becomes a choice between two results in its lane.
"""

from __future__ import annotations

import dis
import re
from functools import cache, lru_cache
from itertools import chain
from types import FunctionType, ModuleType

from detectors.compiled import cached_module, few, few_lanes, reached
from simbench.loop import controller, sensor

TEXT = '''
import numpy as np


@njit(cache=True, error_model="numpy")
def abreast(numbers, op0, pv0, lag, sp0, at, who, value, loads, added, w_room, out):
    """Run LANES loops to the end of the longest; fill `out` (3, n LANES) with their OP, PV, MV, sample after sample.

    `numbers` (parameters, LANES) come in the order of the steps' own. Set points begin at `sp0` and change at sample at[e] for
    lane who[e] to value[e]. `loads` (2, n LANES; none for loops without) is added at the plant's input and output, `added`
    (n LANES) at the sensor. `w_room` takes the plants' inputs: max(lag) samples of the past, which it sets to 0, then n.
    """
    reach = 0
    for l in range(LANES):
        reach = max(reach, lag[l])
    w_room[: reach * LANES] = 0.0
    point, behind = np.empty(LANES), np.empty(LANES, dtype=np.int64)
    for l in range(LANES):
        point[l], behind[l] = sp0[l], (reach - lag[l]) * LANES + l
    ROOMS
    BEGIN
    event = 0
    for k in range(out.shape[1] // LANES):
        while event < at.size and at[event] == k:
            point[who[event]] = value[event]
            event += 1
        row = k * LANES
        SAMPLE
'''

# Two rows of lanes, each as wide as a register: while one waits for its last result, the other computes.
BEGIN = """for l in range(ROW):
    i = FROM + l
    base[l] = op0[i]
    x0[l] = w_old[l] = w_new[l] = w[l] = 0.0
    LOADS
    STARTS
"""
SAMPLE_LOOP = """for l in range(ROW):
    w_new[l] = w_room[np.uintp(row + behind[FROM + l])]
for l in range(ROW):
    sp[l] = point[FROM + l]
for l in range(ROW):
    noise[l] = added[np.uintp(row + FROM + l)]
LOADED
for l in range(ROW):
    BODY
for l in range(ROW):
    w_room[np.uintp(row + reach * LANES + FROM + l)] = w[l]
for l in range(ROW):
    out[0, np.uintp(row + FROM + l)] = op[l]
for l in range(ROW):
    out[1, np.uintp(row + FROM + l)] = s0[l]
for l in range(ROW):
    out[2, np.uintp(row + FROM + l)] = mv[l]
"""
LOADED = """for l in range(ROW):
    load_in[l] = loads[0, np.uintp(row + FROM + l)]
for l in range(ROW):
    load_out[l] = loads[1, np.uintp(row + FROM + l)]
"""
FIXED_ROOMS = ("base", "x0", "w_old", "w_new", "w", "sp", "noise", "load_in", "load_out", "op", "mv", "c0", "c1")


@cache
def iterates(step: FunctionType) -> bool:
    """Return whether a step, or anything it calls, has a loop in it: then it cannot be one instruction for many lanes."""
    return any(i.opname.startswith("JUMP_BACKWARD") for f in reached([step]) for i in dis.get_instructions(f))


@lru_cache(maxsize=256)
def compiled(steps: tuple, stages: tuple[ModuleType, ...], classes: tuple, sizes: tuple[int, ...], loaded: bool):
    """Return `abreast` compiled for one kind of loop, from the disk cache when it is there."""
    *fixed, of_stages = classes
    named = {**{f"class{i}": c for i, c in enumerate(fixed)}, **{f"stage_class{i}": c for i, c in enumerate(of_stages)}}
    valve = {f"{what}{i}": getattr(m, what) for i, m in enumerate(stages) for what in ("start", "step")}
    starts = {
        "controller_start": controller.p_start if dict(steps)["controller_step"] is controller.p_step else controller.pi_start,
        "sensor_start": sensor.full_start if dict(steps)["sensor_step"] is sensor.full_step else sensor.plain_start,
    }
    parts = {**dict(steps), **named, **valve, **starts}
    return cached_module("abreast", {**parts, "few_lanes": few_lanes}, _text(named, sizes, loaded), "numpy").abreast


def _text(named: dict[str, type], sizes: tuple[int, ...], loaded: bool) -> str:
    states = [[f"s{j}" for j in range(sizes[0])]]
    states += [[f"v{i}_{j}" for j in range(size)] for i, size in enumerate(sizes[1:])]
    numbers = {name: [f"{name}_{f}" for f in cls._fields] for name, cls in named.items()}
    given = [*chain(*numbers.values())]
    rooms = [*FIXED_ROOMS, *chain(*states), *given]
    made = {name: f"{name}({', '.join(f'{n}[l]' for n in rows)})" for name, rows in numbers.items()}

    def filled(names: list[str], value: str) -> str:
        return f"{''.join(f'{n}[l], ' for n in names)} = {value}"

    def state(names: list[str]) -> str:
        return f"({''.join(f'{n}[l], ' for n in names)})"

    loads = [f"{n}[l] = numbers[{row}, i]" for row, n in enumerate(given)]
    starts = ["c0[l], c1[l] = controller_start(op0[i], 0.0)", filled(states[0], "sensor_start(pv0[i])"), "mv[l] = op0[i]"]
    body = [
        f"x0[l] = plant_step(w_old[l], w_new[l], (x0[l],), {made['class0']})[0] if k > 0 else x0[l]",
        "w_old[l] = w_new[l]",
        f"y = plant_output((x0[l],), {made['class0']}) + {'load_out[l]' if loaded else '0.0'}",
        filled(states[0], f"sensor_step(y, noise[l], {state(states[0])}, {made['class3']})"),
        f"e = error_step(sp[l] - s0[l], {made['class2']})",
        f"c0[l], c1[l] = controller_step(e, sp[l], (c0[l], c1[l]), {made['class1']})",
        f"op[l] = output_step(c0[l], {made['class2']})",
    ]
    before = "op[l]"
    for i, names in enumerate(states[1:]):
        starts += [filled(names, f"start{i}(mv[l], {made[f'stage_class{i}']})"), f"mv[l] = {names[0]}[l]"]
        body.append(filled(names, f"step{i}({before}, {state(names)}, {made[f'stage_class{i}']})"))
        before = f"{names[0]}[l]"
    body += [f"mv[l] = {before}", f"w[l] = mv[l] - base[l] + {'load_in[l]' if loaded else '0.0'}"]
    begin = _with(_with(BEGIN, "LOADS", loads), "STARTS", starts)
    sample = _with(_with(SAMPLE_LOOP, "BODY", body), "LOADED", LOADED.splitlines() if loaded else [])
    row = few() // 2
    text = TEXT
    for word, one in (("ROOMS", "".join(f"{n} = few_lanes()\n" for n in rooms)), ("BEGIN", begin), ("SAMPLE", sample)):
        both = [_renamed(one, rooms, side).replace("FROM", str(row * side)) for side in (0, 1)]
        text = _with(text, word, "".join(both).splitlines())
    return text.replace("LANES", str(2 * row)).replace("ROW", str(row))


def _with(text: str, word: str, lines: list[str]) -> str:
    """The text with lines in place of a word that stands alone in its line, as far in."""
    return re.sub(rf"^( *){word}$", lambda m: "\n".join(m[1] + line for line in lines), text, flags=re.MULTILINE)


def _renamed(text: str, names: list[str], side: int) -> str:
    """The text with every lane's name marked by the row it belongs to."""
    return re.sub(rf"\b({'|'.join(names)})\b(?=\[| = few)", rf"\1_{side}", text)
