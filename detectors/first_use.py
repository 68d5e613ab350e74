"""What the first use says while kernels are compiled."""

from __future__ import annotations

import sys
import time
from functools import cache
from typing import Any, TextIO

_FIRST_USE = (
    "first use: the numerical kernels are compiled for this computer, once; it takes 10 to 45"
    " seconds, and later commands start at once"
)
SILENCE = 1.0  # s of compiling before anything is said


@cache
def announce() -> None:
    """Watch from now on what is compiled, once and not from every worker."""
    from multiprocessing import parent_process

    from numba.core import event

    if parent_process() is None and sys.__stderr__ is not None:
        event.register("numba:compile", _watch_compiling(sys.__stderr__))


def _watch_compiling(shown_on: TextIO) -> Any:
    """Return a listener that tells once, after a second of silence, that kernels are compiled;
    `shown_on` is the true stderr, whatever a plug-in's output is redirected to.
    """
    from numba.core.event import Listener

    began = time.monotonic()

    class Watch(Listener):
        told = False

        def on_start(self, event):
            if not self.told and time.monotonic() - began >= SILENCE:
                self.told = True
                print(_FIRST_USE, file=shown_on, flush=True)

        def on_end(self, event):
            """Nothing is said of one function."""

    return Watch()
