"""Run valves, effects, plants and controllers of plug-ins in worker processes: a loop that contains
one is simulated in the process of that plug-in.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.detectors.plugins.host import SECONDS, Host, PluginError
from simbench.detectors.plugins.registry import import_hosted
from simbench.loop import echo
from simbench.loop.effects import BLOCKS
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS, VALVES, Choice, Number
from simbench.loop.response import valve_response
from simbench.loop.run import Run
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import CONTROLLER_TYPES, PLANT_TYPES, Loop

_FOLDERS = {folder.kind: folder for folder in (VALVES, EFFECTS, PLANT_PLUGINS, CONTROLLER_PLUGINS)}
_Files = Iterable[str | Path]
# what each kind says of itself beside SOURCE and PARAMETERS, and the words allowed
_WORDS: dict[str, dict[str, tuple]] = {
    "valve": {"FRICTION": (True, False)},
    "effect": {"BLOCK": BLOCKS, "ACTS": ("loop", "record")},
    "plant": {"INTEGRATING": (True, False)},
    "controller": {"INTEGRAL": (True, False)},
}
_hosts: dict[tuple, Host] = {}  # of loops with several plug-ins


@contextlib.contextmanager
def hosted_parts(
    valves: _Files = (),
    effects: _Files = (),
    plants: _Files = (),
    controllers: _Files = (),
    seconds: float = SECONDS,
) -> Iterator[None]:
    """Register plug-in files for the duration of a `with` block; they, and installed plug-ins, run
    in worker processes.
    """
    with contextlib.ExitStack() as stack:
        stack.callback(_close)
        for folder, files in zip(
            _FOLDERS.values(), (valves, effects, plants, controllers), strict=True
        ):
            stack.enter_context(folder.hosted(files, seconds))
        yield


def add_parts(*files_of: _Files, seconds: float = SECONDS) -> None:
    """Make files known as `hosted_parts` does, from here on; those known are asked again."""
    for folder, files in zip(_FOLDERS.values(), files_of, strict=False):
        folder.host_entries = True
        folder.add_hosted(*files, seconds=seconds)
    for host in _hosts.values():
        host.seconds, host.strikes = seconds, 0


def _close() -> None:
    while _hosts:
        _hosts.popitem()[1].close()


def host_of(parts: Iterable[tuple[str, str]]) -> Host | None:
    """Return the worker process of the plug-ins among some parts (kind, name); None if all parts
    are built in.

    >>> host_of([("valve", "choudhury"), ("effect", "noise")]) is None
    True
    """
    own = [
        host
        for kind, name in sorted(set(parts))
        if (host := _FOLDERS[kind].host_of(name)) is not None
    ]
    if len(own) < 2:
        return own[0] if own else None
    sources = tuple(host.sources[0] for host in own)
    if sources not in _hosts:
        _hosts[sources] = Host(_describe_parts, sources, own[0].seconds)
    return _hosts[sources]


def ask(host: Host | None, function: Callable, *arguments: Any) -> Any:
    """Return what a function gives in a worker, or here where there is none."""
    return function(*arguments) if host is None else host.call(function, *arguments)


def _describe_parts(sources: Iterable[tuple[str, str]]) -> list[dict[str, Any]]:
    """Import parts in their worker, and return their descriptions; ParameterError where one
    describes nothing of its kind.
    """
    said = []
    for kind, source in sources:
        module = import_hosted(_FOLDERS[kind], source)
        rules = module.PARAMETERS
        if not isinstance(rules, dict) or not all(
            isinstance(rule, (Number, Choice)) for rule in rules.values()
        ):
            raise ParameterError(
                f"PARAMETERS = {rules!r:.60}; a dict of Number and Choice is needed"
            )
        for word, values in _WORDS[kind].items():
            if getattr(module, word) not in values:
                raise ParameterError(
                    f"{word} = {getattr(module, word)!r}; allowed: {', '.join(map(str, values))}"
                )
        words = {word: getattr(module, word) for word in ("PARAMETERS", *_WORDS[kind])}
        said.append({**words, "SOURCE": str(module.SOURCE), "__doc__": str(module.__doc__ or "")})
    return said


for _folder in _FOLDERS.values():
    _folder.describe = _describe_parts


def parts_of_loop(loop: Loop) -> set[tuple[str, str]]:
    """Return kind and name of every valve stage and effect a loop names.

    >>> loop = Loop.from_table({
    ...     "plant": {"type": "integrating", "K": 1}, "controller": {"type": "P", "Kc": 1},
    ...     "sampling": {"Ts": 1}, "valve": {"model": "lag", "T": 2.0},
    ...     "effect": [{"name": "stiction", "S": 5, "J": 2}]})
    >>> sorted(parts_of_loop(loop))
    [('effect', 'stiction'), ('valve', 'lag')]
    """
    stages = [
        s for place in ("before", "behind") for s in _listed(loop.valve.parameters.get(place))
    ]
    valves = {loop.valve.name, *(s.get("model") for s in stages if isinstance(s, dict))}
    valves |= {str(d.parameters.get(echo.VALVE)) for d in loop.disturbance if d.name == echo.NAME}
    named = {("valve", name) for name in valves if isinstance(name, str)} | {
        ("effect", e.name) for e in loop.effect
    }
    laws = (
        ("plant", loop.plant.type, PLANT_TYPES),
        ("controller", loop.controller.type, CONTROLLER_TYPES),
    )
    return named | {(kind, name) for kind, name, own in laws if name not in own}


def _listed(value: Any) -> list:
    return value if isinstance(value, list) else []


def simulated(loop: Loop, seed: int = 0, kick: float = 0.0) -> Run:
    """Return `simulate(loop, seed, kick=kick)`, wherever its parts live."""
    with _with_help():
        return valid_run(
            ask(host_of(parts_of_loop(loop)), partial(simulate, kick=kick), loop, seed), loop
        )


def response(model: str, op: np.ndarray, parameters: Mapping[str, Any], Ts: float) -> np.ndarray:
    """Return `valve_response(model, op, parameters, Ts)`, wherever the valve lives."""
    with _with_help():
        mv = ask(host_of([("valve", model)]), valve_response, model, op, parameters, Ts)
        if not isinstance(mv, np.ndarray) or mv.shape != op.shape or not np.isfinite(mv).all():
            raise PluginError(f"valve {model!r} gives positions that are not finite, or too few")
    return mv


@contextlib.contextmanager
def _with_help() -> Iterator[None]:
    try:
        yield
    except PluginError as error:
        raise PluginError(
            f"{error}; `simbench contract FILE` says what such a file needs"
        ) from None


def valid_run(run: Run, loop: Loop) -> Run:
    """Return the run of a loop; PluginError where a signal is not finite, or of another length."""
    record = run.record
    for signal in (record.op, record.pv, record.sp, record.mv, run.load_in, run.load_out, run.mv):
        if signal is None or signal.shape != (loop.sampling.n,) or not np.isfinite(signal).all():
            raise PluginError("its loop gives signals that are not finite, or of another length")
    return run
