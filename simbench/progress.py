"""Show the progress of long work on stderr: a bar on a terminal, at most one line a minute
elsewhere.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from tqdm import tqdm

BETWEEN_LINES = 60.0  # s, between two lines in a log
_BETWEEN_FRAMES = 0.1  # s, between two drawings of a bar


class Progress(tqdm):
    """How many of some items are done: over `items`, or told by `update`.

    A bar appears after `delay` seconds. Where stderr is no terminal whole lines take its place.
    `shown` asks for the bar wherever stderr leads, or for nothing.
    """

    monitor_interval = 0  # no thread of its own: a process with another one is not copied

    def __init__(
        self,
        items: Iterable[Any] | None = None,
        *,
        total: int | None = None,
        initial: int = 0,
        desc: str = "",
        unit: str = "it",
        delay: float = 0.0,
        shown: bool | None = None,
    ) -> None:
        # how often something is drawn or printed
        self._lines = not (shown or sys.stderr.isatty())
        pause = BETWEEN_LINES if self._lines else _BETWEEN_FRAMES
        delay = BETWEEN_LINES if self._lines else delay

        # the rest is counted by tqdm
        about = {"total": total, "initial": initial, "desc": desc, "unit": unit}
        about |= {"mininterval": pause, "miniters": 1, "delay": delay}  # by the clock alone
        super().__init__(items, **about, disable=shown is False)

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        """Draw the bar, or print a line."""
        if not self._lines:
            super().display(msg, pos)
            return
        now = self.format_dict
        pace = (self.n - self.initial) / max(now["elapsed"], 1e-9)
        if self.total and pace:
            left = self.format_interval((self.total - self.n) / pace)
        else:
            left = "?"
        spent = self.format_interval(now["elapsed"])
        counted = f"{self.n} of {self.total or '?'}"
        print(f"{self.desc}: {counted} after {spent}, {left} left", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Leave the bar as it stands; a log keeps its lines."""
        self.disable = self.disable or self._lines
        super().close()

    def skip(self, count: int) -> None:
        """Count items as done that were done before, without letting them flatter the rate."""
        if not self.disable:
            self.initial += count
        self.update(count)
