"""Load valves, effects, plants and controllers from files of the user. They run in this process."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from simbench.detectors.errors import ParameterError, RecordError, UserError
from simbench.detectors.plugins.registry import PluginFolder
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS, VALVES, Choice, Number
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

FOLDERS = (VALVES, EFFECTS, PLANT_PLUGINS, CONTROLLER_PLUGINS)
_Files = Iterable[str | Path]
_LONGEST = 300  # characters of an error's text
# the loop in which a part is tried, and how the part stands in it
_LOOP: dict[str, Any] = {
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 1.0},
    "controller": {"type": "PI", "Kc": 0.5, "Ti": 10.0},
    "sampling": {"Ts": 1.0, "n": 3},
}
_IN_LOOP: dict[str, Callable[[str, dict], dict]] = {
    "valve": lambda name, table: {"valve": {"model": name, **table}},
    "effect": lambda name, table: {"effect": [{"name": name, **table}]},
    "plant": lambda name, table: {"plant": {"type": name, "Td": 1.0, **table}},
    "controller": lambda name, table: {"controller": {"type": name, **table}},
}


def add_parts(*files_of: _Files) -> None:
    """Register files of valves, effects, plants and controllers, in this order."""
    for folder, files in zip(FOLDERS, files_of, strict=False):
        folder.add_files(*files)


def _try_parts(folder: PluginFolder, names: Iterable[str]) -> None:
    """Run a loop for one step with each part; ParameterError for one that raises what is no refusal
    of its parameters.
    """
    # Parameters without a default get a value of their range
    for name in names:
        module = folder.load(name)
        wanted = {}
        for k, r in module.PARAMETERS.items():
            if r.default is None:
                wanted[k] = r
        table = {}
        for key, rule in wanted.items():
            table[key] = _value_of(rule)

        # A step in the smallest loop that has such a part
        loop = {**_LOOP, **_IN_LOOP[folder.kind](name, table)}
        try:
            simulate(Loop.from_table(loop), 0)
        except (UserError, ValueError):
            continue  # a part may refuse what was chosen for it
        except (Exception, SystemExit) as error:
            raise ParameterError(
                f"{folder.kind} {name!r} ({module.__file__}) fails in its first step:"
                f" {error_text(error)}; one that runs is needed"
            ) from error


def _value_of(rule: Number | Choice) -> float | str:
    """Return a value in the middle of a parameter's range, near its end where that is open."""
    if isinstance(rule, Choice):
        return rule.names[0]
    low = rule.low if math.isfinite(rule.low) else 0.0
    if math.isfinite(rule.high):
        return 0.5 * (low + rule.high)
    return low + 1.0


@contextlib.contextmanager
def added_parts(*files_of: _Files) -> Iterator[None]:
    """Register such files for the duration of a `with` block."""
    with contextlib.ExitStack() as stack:
        for folder, files in zip(FOLDERS, files_of, strict=False):
            names = stack.enter_context(folder.added(files))
            _try_parts(folder, names)
        yield


@contextlib.contextmanager
def naming_parts() -> Iterator[None]:
    """Raise ParameterError, which names the parts that are not of the package, for whatever goes
    wrong while one of them takes part.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        names = []
        for folder in FOLDERS:
            for name in folder.outside():
                names.append(f"{folder.kind} {name!r}")
        # signals that are none are a part's doing; other sentences of ours name what is wrong
        ours = isinstance(error, UserError) and not isinstance(error, RecordError)
        if ours or not names:
            raise
        raise ParameterError(
            f"the loop with {' and '.join(names)} fails: {error_text(error)}; parts that run are"
            " needed"
        ) from error


def error_text(error: BaseException) -> str:
    """Return an error in one line, as tables hold it."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:_LONGEST]
