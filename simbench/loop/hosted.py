"""Parts of others (valves, effects, plants, controllers): what one takes part in is computed in a process of its own."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

import numpy as np

from detectors.errors import ParameterError
from detectors.plugins.host import MESSAGE, SECONDS, Host, PluginError
from detectors.plugins.rebuilt import number_of
from detectors.record import LoopRecord
from scenarios.spec import CONTROLLER_TYPES, PLANT_TYPES, Loop
from simbench.loop.effects import BLOCKS
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS, VALVES, Choice, Number
from simbench.loop.response import valve_response
from simbench.loop.run import Run
from simbench.loop.simulate import simulate

_SIGNALS = ("op", "pv", "sp", "mv")
_LONGEST_NOTE = 300  # characters
SAMPLE = 100  # bytes of an answer, per sample
_FOLDERS = {folder.kind: folder for folder in (VALVES, EFFECTS, PLANT_PLUGINS, CONTROLLER_PLUGINS)}
_Files = Iterable[str | Path]
_BOTH = (True, False)
# what each kind says of itself beside SOURCE and PARAMETERS, and the words allowed
_WORDS: dict[str, dict[str, tuple]] = {
    "valve": {"FRICTION": _BOTH},
    "effect": {"BLOCK": BLOCKS, "ACTS": ("loop", "record")},
    "plant": {"INTEGRATING": _BOTH},
    "controller": {"INTEGRAL": _BOTH},
}


class PartHost(Host):
    """A process that knows one part of others, or the few of one loop: kind and file, or published name, of each."""

    def __init__(self, files: tuple[tuple[str, Path | str], ...], seconds: float = SECONDS) -> None:
        words = [(kind, str(source)) for kind, source in files]
        folders = [source.parent for _, source in files if isinstance(source, Path)]
        super().__init__(_describe_parts, words, seconds=seconds, folders=folders)
        self.files = files

    def stub(self) -> ModuleType:
        """Return what stands for the one part here: all that it says of itself, and no step."""
        kind, source = self.files[0]
        with self._named():
            return _stub(kind, Path(source).stem, self.described()[0])

    def ask(self, function: Callable, *arguments: Any, samples: int = 0) -> Any:
        """Return what a function gives there, about so many samples; ParameterError for what it refuses, else PluginError."""
        with self._named():
            return self.call(function, *arguments, most=MESSAGE + SAMPLE * samples)

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        names = [(kind, Path(source).stem) for kind, source in self.files]
        who = " or ".join(f"{kind} plug-in {name!r}" for kind, name in names)
        try:
            yield
        except PluginError as error:
            text = error.refusal or str(error)
            text = text if any(repr(name) in text for _, name in names) else f"{who}: {text}"
            raise ParameterError(text) if error.refusal else PluginError(text) from None


_hosts: dict[tuple, PartHost] = {}
for _folder in _FOLDERS.values():
    _folder.make_host = lambda source, seconds, kind=_folder.kind: PartHost(((kind, source),), seconds)


@contextlib.contextmanager
def hosted_parts(
    valves: _Files = (), effects: _Files = (), plants: _Files = (), controllers: _Files = (), seconds: float = SECONDS
) -> Iterator[None]:
    """Make files of parts known for one question; these, and what is installed, live in processes of their own."""
    with contextlib.ExitStack() as stack:
        stack.callback(_close)
        for folder, files in zip(_FOLDERS.values(), (valves, effects, plants, controllers), strict=True):
            stack.enter_context(folder.entries_hosted())
            stack.enter_context(folder.hosted(files, seconds))
        yield


def add_parts(*files_of: _Files, seconds: float = SECONDS) -> None:
    """Make files known as `hosted_parts` does, from here on; those known are asked again."""
    for folder, files in zip(_FOLDERS.values(), files_of, strict=False):
        folder.host_entries = True
        folder.add_all_hosted(files, seconds)
    for host in _hosts.values():
        host.seconds, host.strikes = seconds, 0


def _close() -> None:
    while _hosts:
        _hosts.popitem()[1].close()


def host_of(parts: Iterable[tuple[str, str]]) -> PartHost | None:
    """Return the process in which those of others among some parts (kind, name) live; None where all are of the house.

    >>> host_of([("valve", "choudhury"), ("effect", "noise")]) is None
    True
    """
    own = [host for kind, name in sorted(set(parts)) if (host := _FOLDERS[kind].host_of(name)) is not None]
    if len(own) < 2:
        return own[0] if own else None
    files = tuple(host.files[0] for host in own)
    if files not in _hosts:
        _hosts[files] = PartHost(files, own[0].seconds)
    return _hosts[files]


def _describe_parts(files: list[tuple[str, str]]) -> list[dict[str, Any]]:
    """Import parts where this runs, in their own process, and return their descriptions as plain values."""
    said = []
    for kind, source in files:
        folder = _FOLDERS[kind]
        module = folder.load(folder.add_file(source) if os.sep in source else source)
        if not isinstance(module.PARAMETERS, dict):
            raise TypeError(f"PARAMETERS is a {type(module.PARAMETERS).__name__}, a dict of Number and Choice is needed")
        words = {word: getattr(module, word, None) for word in ("SOURCE", "PARAMETERS", *_WORDS[kind])}
        said.append({**words, "doc": (module.__doc__ or "").strip().partition("\n\n")[0]})
    return said


def parts_of_loop(loop: Loop) -> set[tuple[str, str]]:
    """Return kind and name of every valve stage and effect a loop names.

    >>> loop = Loop.from_table({
    ...     "plant": {"type": "integrating", "K": 1}, "controller": {"type": "P", "Kc": 1}, "sampling": {"Ts": 1},
    ...     "valve": {"model": "lag", "T": 2.0}, "effect": [{"name": "stiction", "S": 5, "J": 2}]})
    >>> sorted(parts_of_loop(loop))
    [('effect', 'stiction'), ('valve', 'lag')]
    """
    stages = [s for place in ("before", "behind") for s in _listed(loop.valve.parameters.get(place))]
    valves = {loop.valve.name, *(s.get("model") for s in stages if isinstance(s, dict))}
    named = {("valve", name) for name in valves if isinstance(name, str)} | {("effect", e.name) for e in loop.effect}
    laws = (("plant", loop.plant.type, PLANT_TYPES), ("controller", loop.controller.type, CONTROLLER_TYPES))
    return named | {(kind, name) for kind, name, own in laws if name not in own}


def _listed(value: Any) -> list:
    return value if isinstance(value, list) else []


def simulated(loop: Loop, seed: int = 0, kick: float = 0.0) -> Run:
    """Return `simulate(loop, seed, kick=kick)`, wherever its parts live."""
    host = host_of(parts_of_loop(loop))
    if host is None:
        return simulate(loop, seed, kick=kick)
    with _helped():
        return run_of(host.ask(partial(simulate, kick=kick), loop, seed, samples=loop.sampling.n), loop)


def response(model: str, op: np.ndarray, parameters: Mapping[str, Any], Ts: float) -> np.ndarray:
    """Return `valve_response(model, op, parameters, Ts)`, wherever the valve lives."""
    host = host_of([("valve", model)])
    if host is None:
        return valve_response(model, op, parameters, Ts)
    with _helped():
        mv = host.ask(valve_response, model, op, parameters, Ts, samples=op.size)
        if not isinstance(mv, np.ndarray) or mv.shape != op.shape or not np.isfinite(mv).all():
            raise PluginError(f"valve plug-in {model!r} gives positions that are not finite, or too few")
    return mv


@contextlib.contextmanager
def _helped() -> Iterator[None]:
    """Say, behind what a plug-in did, where it is told what it must do."""
    try:
        yield
    except PluginError as error:
        raise PluginError(f"{error}; `simbench contract FILE` says what such a file needs") from None


def run_of(said: Any, loop: Loop) -> Run:
    """Return the run that plain values describe; PluginError where they describe none of this loop."""
    n, said = loop.sampling.n, said if isinstance(said, dict) else {}
    recorded = said.get("record")
    known = {**said, **(recorded if isinstance(recorded, dict) else {}), "valve": said.get("mv")}
    signals = [known.get(k) for k in (*_SIGNALS, "load_in", "load_out", "valve")]
    if not all(isinstance(s, np.ndarray) and s.shape == (n,) and np.isfinite(s).all() for s in signals):
        raise PluginError("its loop gives signals that are not finite, or of another length")
    op, pv, sp, mv, load_in, load_out, valve = signals
    record = LoopRecord(op=op, pv=pv, sp=sp, mv=mv, Ts=loop.sampling.Ts, process=known.get("process"), op_span=(0.0, 100.0))
    band = said.get("friction")
    S, J = (number_of(x, "mapped_SJ") for x in (band if isinstance(band, (tuple, list)) and len(band) == 2 else (0.0, 0.0)))
    notes = tuple(str(note)[:_LONGEST_NOTE] for note in said.get("notes") or ())
    return Run(record, load_in, load_out, None, said["sticky"] is True, valve, (S, J), notes, _outer_of(said.get("outer"), n))


def _outer_of(said: Any, n: int) -> LoopRecord | None:
    """Return the outer loop's record of a cascade that plain values describe; None where there is none."""
    signals = {s: said.get(s) for s in ("op", "pv", "sp")} if isinstance(said, dict) else {}
    if not signals or not all(isinstance(s, np.ndarray) and s.shape == (n,) for s in signals.values()):
        return None
    return LoopRecord(Ts=said["Ts"], process=said["process"], op_span=(0.0, 100.0), **signals)  # type: ignore[arg-type]


def _stub(kind: str, name: str, said: Mapping[str, Any]) -> ModuleType:
    """Rebuild a part's description of itself from plain values, each checked."""
    stub = ModuleType(name, str(said.get("doc", "")))
    for word, values in _WORDS[kind].items():
        if said.get(word) not in values:
            raise PluginError(f"{word} = {said.get(word)!r}; allowed: {', '.join(str(v) for v in values)}")
        setattr(stub, word, said[word])
    rules = said.get("PARAMETERS")
    if not isinstance(rules, dict) or not all(isinstance(r, dict) for r in rules.values()):
        raise PluginError("PARAMETERS is no dict of Number and Choice")
    functions = ("apply",) if kind == "effect" else ("start", "step")
    stub.__dict__.update({f: partial(_elsewhere, f"{kind} {name!r}") for f in functions})
    stub.__dict__.update(SOURCE=str(said.get("SOURCE")), PARAMETERS={k: _rule(k, r) for k, r in rules.items()}, __file__=None)
    return stub


def _rule(key: str, said: Mapping[str, Any]) -> Number | Choice:
    default, says = said.get("default"), str(said.get("says", ""))
    if "names" in said:
        names = said.get("names")
        if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
            raise PluginError(f"parameter {key} is neither a Number nor a Choice of words")
        return Choice(tuple(names), default if isinstance(default, str) else None, says)
    low, high, identity = (number_of(said.get(k), f"{key}.{k}") for k in ("low", "high", "identity"))
    default = None if default is None else number_of(default, f"{key}.default")
    return Number(str(said.get("unit")), low, high, default, says, said.get("positive") is True, identity)


def _elsewhere(what: str, *_: Any) -> NoReturn:
    raise PluginError(f"{what} is a plug-in, which moves in a process of its own alone")
