"""Rules that every kind of plug-in of a loop must keep: what its file says of itself, its table of
parameters, and the same answer compiled as in plain Python.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Any

from simbench.detectors.contract.watch import call_guarded
from simbench.loop.parameters import Choice, Number


def head_faults(kind: str, module: ModuleType, flag: str) -> Iterator[str]:
    """Say what is wrong with a plug-in's first sentence, its SOURCE and its flag."""
    if not (module.__doc__ or "").strip():
        yield f"the file does not begin with a sentence on what the {kind} does"
    if not str(module.SOURCE).strip():
        yield "SOURCE is empty"
    if not isinstance(getattr(module, flag), bool):
        yield f"{flag} = {getattr(module, flag)!r}, true or false is needed"


def schema_faults(schema: Any) -> Iterator[str]:
    """Say what is wrong with a plug-in's PARAMETERS."""
    if not isinstance(schema, dict):
        yield f"PARAMETERS is a {type(schema).__name__}, a dict of Number and Choice is needed"
        return
    for key, rule in schema.items():
        if not isinstance(rule, (Number, Choice)):
            yield f"parameter {key} is {rule!r}, a Number or a Choice is needed"
            continue
        if not rule.says:
            yield f"parameter {key} does not say what it is"
        if isinstance(rule, Number) and not rule.low < rule.high:
            yield f"parameter {key} has no range: {rule.low:g} to {rule.high:g}"


def inside(rule: Number | Choice, percent: float) -> float | str:
    """Return a value that a parameter allows, so many percent into its range."""
    if isinstance(rule, Choice):
        return rule.names[-1]
    if math.isfinite(rule.low) and math.isfinite(rule.high):
        return rule.low + percent * (rule.high - rule.low) / 100.0
    return (rule.low if math.isfinite(rule.low) else 0.0) + 2.5 * percent


def shown(table: dict[str, Any]) -> str:
    """Return parameters in words."""
    words = (
        f"{key} = {value if isinstance(value, str) else f'{value:g}'}"
        for key, value in table.items()
    )
    return ", ".join(words) or "defaults"


def both_ways(run: Callable[[bool], Any]) -> tuple[list[Any], list[str]]:
    """Return what a run answers in plain Python and compiled, or why one of them does not."""
    answers = []
    for plain, how in ((True, "in plain Python"), (False, "compiled")):
        answer = call_guarded(partial(run, plain))
        if faults := answer.unanswered():
            return [], [f"{' '.join(fault.split())[:300]}, {how}" for fault in faults]
        answers.append(answer.value)
    return answers, []


def walked(
    start: Callable[[], Any], step: Callable[[float, Any], Any], inputs: Iterable[float], where: str
) -> tuple[list[tuple], list[str]]:
    """Return the states of a step function from `start` under some inputs, or what is wrong with
    them, `where` it is.
    """

    def walk() -> list[Any]:
        states = [start()]
        for x in inputs:
            if not _is_state(states[-1], states[0]):
                break
            states.append(step(x, states[-1]))
        return states

    answer = call_guarded(walk)
    if faults := answer.unanswered():
        return [], [f"{fault}, {where}" for fault in faults]
    last = answer.value[-1]
    if not _is_state(last, answer.value[0]):
        fault = f"gives the state {last!r}; a tuple of one length throughout is needed, {where}"
        return [], [fault]
    return answer.value, []


def _is_state(state: Any, first: Any) -> bool:
    return isinstance(state, tuple) and 0 < len(state) == len(first)
