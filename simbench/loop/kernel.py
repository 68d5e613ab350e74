"""The compiled loop: one readable Python function, bound to the steps a loop needs and compiled
once per combination.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numpy as np

from simbench.detectors.compiled import cached_module, names_used, reached

# Bound by `bind` (plain Python, the slow twin) or by a generated module (compiled).
error_step: Any = None
controller_step: Any = None
controller_kick: Any = None
output_step: Any = None
valve_step: Any = None
plant_step: Any = None
plant_output: Any = None
sensor_step: Any = None
outer_step: Any = None
outer_plant_step: Any = None
outer_plant_output: Any = None
named: Any = None


def closed_loop(sp, load_in, load_out, noise, moves, op0, w, x, c, v, s, numbers, op, pv, mv):
    """Run the loop; all signals are arrays of n samples, states are tuples, `numbers` are the
    parameters as bare tuples.

    `w` (n + delay + 1,) is the plant's input as deviation from op0, its first delay + 1 entries the
    past; `moves` (%) are added to OP, and the controller goes on from there. Fills `op`, `pv` and
    `mv`.
    """
    # The parts' numbers by name
    plant, controller, gap, sensor, valve = named(numbers)
    lag = w.shape[0] - sp.shape[0]
    w_now = w[lag:]
    w_new = w[1:]

    # Sensor, controller, valve, plant, in this order
    for k in range(sp.shape[0]):
        s = sensor_step(plant_output(x, plant) + load_out[k], noise[k], s, sensor)
        c = controller_step(error_step(sp[k] - s[0], gap), sp[k], c, controller)
        if moves[k] != 0.0:
            c = controller_kick(c, moves[k], controller)
        u = output_step(c[0], gap)
        v = valve_step(u, v, valve)
        w_now[k] = v[-1][0] - op0 + load_in[k]
        x = plant_step(w[k], w_new[k], x, plant)

        # What is recorded
        pv[k] = s[0]
        op[k] = u
        mv[k] = v[-1][0]


def cascade(
    sp,
    outer_noise,
    lo,
    per,
    point,
    load_in,
    load_out,
    noise,
    moves,
    op0,
    lags,
    w,
    x,
    c,
    v,
    s,
    X,
    C,
    numbers,
    op,
    pv,
    mv,
    outer_op,
    outer_pv,
):
    """Run a loop whose set point `point` is lo + per times the OP of another loop, which it fills
    too.

    Both plants are driven by the valve: the outer one is the two in series, so that both are
    sampled exactly. `lags` are their samples of dead time + 1, `w` begins with as many of the past
    as the longer has.
    """
    # The parts' numbers by name
    plant, controller, gap, sensor, outer_plant, outer, valve = named(numbers)
    past = w.shape[0] - sp.shape[0]
    w_now = w[past:]
    w_in = w[past - lags[0] :]
    w_out = w[past - lags[1] :]

    # The outer loop writes the inner set point
    for k in range(sp.shape[0]):
        y = outer_plant_output(X, outer_plant) + outer_noise[k]
        C = outer_step(sp[k] - y, sp[k], C, outer)
        point[k] = lo + per * C[0]

        # The inner loop as in `closed_loop`
        s = sensor_step(plant_output(x, plant) + load_out[k], noise[k], s, sensor)
        c = controller_step(error_step(point[k] - s[0], gap), point[k], c, controller)
        if moves[k] != 0.0:
            c = controller_kick(c, moves[k], controller)
        u = output_step(c[0], gap)
        v = valve_step(u, v, valve)
        w_now[k] = v[-1][0] - op0 + load_in[k]
        x = plant_step(w_in[k], w_in[k + 1], x, plant)

        # The outer plant answers to the inner one's input
        X = outer_plant_step(w_out[k], w_out[k + 1], X, outer_plant)
        outer_op[k] = C[0]
        outer_pv[k] = y
        op[k] = u
        pv[k] = s[0]
        mv[k] = v[-1][0]


def valve_chain(stages):
    """Return the text of a function that sends OP through the given number of valve stages in
    turn.
    """
    lines = ["def valve_step(u, v, p):"]
    for i in range(stages):
        lines.append(f"    v{i} = stage{i}({'u' if i == 0 else f'v{i - 1}[0]'}, v[{i}], p[{i}])")
    lines.append(f"    return ({''.join(f'v{i}, ' for i in range(stages))})")
    return "\n".join(lines) + "\n"


def naming(classes):
    """Return the text of a function that gives bare tuples of parameters their names again.

    numba takes bare tuples of numbers at the speed of C, named ones ten times slower.
    """
    *fixed, stages = classes
    parts = [f"class{i}(*n[{i}])" for i in range(len(fixed))]
    valve = "".join(f"stage_class{i}(*n[{len(fixed)}][{i}]), " for i in range(len(stages)))
    return f"def named(n):\n    return {', '.join(parts)}, ({valve})\n"


def bind(
    steps: dict[str, FunctionType], stages: tuple[FunctionType, ...], classes: tuple
) -> FunctionType:
    """Return `closed_loop`, or `cascade`, in plain Python for the given steps: the slow, obvious
    twin of `compiled`.
    """
    scope = _scope_of_steps(stages, classes)
    exec(naming(classes) + valve_chain(len(stages)), scope)
    return FunctionType(_loop_of(steps).__code__, {**globals(), **steps, **scope})


def compiled(
    steps: dict[str, FunctionType], stages: tuple[FunctionType, ...], classes: tuple
) -> FunctionType:
    """Return `closed_loop`, or `cascade`, compiled for the given steps, from the disk cache when it
    is there.

    numba's disk cache only watches the file a function stands in. So each combination is written to
    a module of its own whose name carries the hash of every source that takes part: an edited valve
    never meets an old kernel.
    """
    return _compile_loop(tuple(sorted(steps.items())), stages, classes)


# what a compiled step may find among the names of its module
_COMPILED = (FunctionType, BuiltinFunctionType, type, ModuleType, int, float, np.ufunc, np.ndarray)
# of what the loop alone calls, no entry for Python or C is compiled
_UNCALLED = "no_cpython_wrapper=True, no_cfunc_wrapper=True"
_plainly: dict[FunctionType, str] = {}  # steps that numba cannot compile, and why


def compiled_where_possible(
    steps: dict[str, FunctionType], stages: tuple[FunctionType, ...], classes: tuple
) -> Callable[..., None]:
    """Return `closed_loop` as `compiled` does, or in plain Python where a step of others cannot be
    compiled.
    """
    outside = [steps[name] for name in ("plant_step", "controller_step")]

    def run(*arguments: Any) -> None:
        from numba.core.errors import NumbaError, UnsupportedBytecodeError

        for step in outside:
            odd = []
            for f in reached([step]):
                for n, v in names_used(f).items():
                    if not isinstance(v, _COMPILED):
                        odd.append(n)
            if odd and step not in _plainly:
                _plainly[step] = f"it uses {odd[0]}"
        if not any(step in _plainly for step in outside):
            try:
                return compiled(steps, stages, classes)(*arguments)
            except (NumbaError, UnsupportedBytecodeError) as error:
                for step in outside:
                    if Path(step.__code__.co_filename).parent == Path(__file__).parent:
                        continue
                    _plainly[step] = f"numba cannot compile it ({type(error).__name__})"
        return bind(steps, stages, classes)(*arguments)

    return run


def runs_plainly(step: FunctionType) -> str:
    """Return why a step runs in plain Python, in a sentence; "" of one that is compiled."""
    name = Path(step.__code__.co_filename).stem
    if step in _plainly:
        return f"{name!r} runs in plain Python, some 100 times slower: {_plainly[step]}"
    return ""


@lru_cache(maxsize=256)
def _compile_loop(steps, stages, classes):
    loop = _loop_of(dict(steps))
    text = (
        f"@njit({_UNCALLED})\n{naming(classes)}\n\n@njit({_UNCALLED})\n{valve_chain(len(stages))}\n\n"
        f"@njit(cache=True, no_cfunc_wrapper=True)\n{inspect.getsource(loop)}"
    )
    return getattr(
        cached_module("loop", {**dict(steps), **_scope_of_steps(stages, classes)}, text),
        loop.__name__,
    )


def _loop_of(steps: dict[str, FunctionType]) -> FunctionType:
    return cascade if "outer_step" in steps else closed_loop


def _scope_of_steps(stages, classes) -> dict:
    *fixed, of_stages = classes
    return {
        **{f"stage{i}": f for i, f in enumerate(stages)},
        **{f"class{i}": c for i, c in enumerate(fixed)},
        **{f"stage_class{i}": c for i, c in enumerate(of_stages)},
    }
