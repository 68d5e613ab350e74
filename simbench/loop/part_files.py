"""Load valves, effects, plants and controllers from files of the user. They run in this process."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from simbench.detectors.errors import ParameterError, RecordError, UserError
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS, VALVES

FOLDERS = (VALVES, EFFECTS, PLANT_PLUGINS, CONTROLLER_PLUGINS)
_Files = Iterable[str | Path]
_LONGEST = 300  # characters of an error's text


def add_parts(*files_of: _Files) -> None:
    """Register files of valves, effects, plants and controllers, in this order."""
    for folder, files in zip(FOLDERS, files_of, strict=False):
        folder.add_files(*files)


@contextlib.contextmanager
def added_parts(*files_of: _Files) -> Iterator[None]:
    """Register such files for the duration of a `with` block."""
    with contextlib.ExitStack() as stack:
        for folder, files in zip(FOLDERS, files_of, strict=False):
            stack.enter_context(folder.added(files))
        yield


@contextlib.contextmanager
def naming_parts() -> Iterator[None]:
    """Raise ParameterError, which names the parts that are not of the package, for whatever goes
    wrong while one of them takes part.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        names = [f"{folder.kind} {name!r}" for folder in FOLDERS for name in folder.outside()]
        # signals that are none are a part's doing; other sentences of ours name what is wrong
        ours = isinstance(error, UserError) and not isinstance(error, RecordError)
        if ours or not names:
            raise
        raise ParameterError(
            f"the loop with {' and '.join(names)} fails: {error_text(error)}; `simbench contract"
            " FILE` says what such a file needs"
        ) from error


def error_text(error: BaseException) -> str:
    """Return an error in one line, as tables hold it."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:_LONGEST]
