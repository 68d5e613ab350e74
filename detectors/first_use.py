"""What the first use says while kernels are compiled."""

from __future__ import annotations

import sys
import threading
import time
from functools import cache
from typing import Any, TextIO

_FIRST_USE = (
    "first use: the numerical kernels are compiled for this computer, once; it takes 10 to 45"
    " seconds, and later commands start at once"
)
SILENCE = 1.0  # s of compiling before anything is said
_PAUSE = 0.4  # s without a function being compiled, after which none is expected
_FUNCTIONS = 54  # that `detect` compiles at its first use: the length of the bar


@cache
def announce() -> None:
    """Watch from now on what is compiled, once and not from every worker."""
    from multiprocessing import parent_process

    from numba.core import event

    if parent_process() is None and sys.__stderr__ is not None:
        event.register("numba:compile", _watch(sys.__stderr__))


def _watch(shown_on: TextIO) -> Any:
    """Return a listener that tells, after a second of silence, that kernels are compiled, and at a
    terminal how many are; `shown_on` is the true stderr, whatever a plug-in's output is redirected
    to.
    """
    from numba.core.event import Listener

    class Watch(Listener):
        def __init__(self):
            self.running = 0
            self.done = 0
            self.told = False
            self.began = self.ended = time.monotonic()
            self.thread = None

        def on_start(self, event):
            self.running += 1
            if time.monotonic() - self.began >= SILENCE:
                self.say()
            if self.thread is None or not self.thread.is_alive():
                self.thread = threading.Thread(target=self.tell, daemon=True)
                self.thread.start()

        def on_end(self, event):
            self.running -= 1
            self.done += 1
            self.ended = time.monotonic()

        def say(self):
            """Say once what happens."""
            if not self.told:
                self.told = True
                print(_FIRST_USE, file=shown_on, flush=True)

        def tell(self):
            """Speak while functions are compiled; what was drawn is wiped once none is."""
            at_terminal = shown_on.isatty()
            drawn = False
            while self.running or time.monotonic() - self.ended < _PAUSE:
                if time.monotonic() - self.began >= SILENCE:
                    self.say()
                    if at_terminal:
                        full = min(self.done, _FUNCTIONS) * 30 // _FUNCTIONS
                        bar = f"[{'#' * full}{'.' * (30 - full)}] {self.done} functions compiled"
                        print(f"\r{bar}", end="", file=shown_on, flush=True)
                        drawn = True
                time.sleep(0.05)
            if drawn:
                print("\r\x1b[K", end="", file=shown_on, flush=True)

    return Watch()
