"""Show the progress of long work on stderr: a bar on a terminal, at most one line a minute
elsewhere.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from datetime import timedelta
from typing import Any

BETWEEN_LINES = 60.0  # s, between two lines in a log
_BETWEEN_FRAMES = 0.1  # s, between two drawings of a bar


class Progress:
    """How many of some items are done: over `items`, or told by `update`.

    A bar appears after `delay` seconds. Where stderr is no terminal whole lines take its place.
    `shown` asks for the bar wherever stderr leads, or for nothing.
    """

    def __init__(
        self,
        items: Iterable[Any] = (),
        *,
        total: int | None = None,
        initial: int = 0,
        desc: str = "",
        unit: str = "",
        delay: float = 0.0,
        shown: bool | None = None,
    ) -> None:
        self.note = ""  # behind the bar
        self._items = items
        self._desc = desc
        self._unit = unit
        self._total = len(items) if total is None and isinstance(items, Sized) else total
        self._done = self._skipped = initial
        self._off = shown is False
        self._asked = shown is True
        self._lines = not (shown or sys.stderr.isatty())
        self._began = self._told = time.monotonic()
        self._delay = delay
        self._bar = None

    def __iter__(self) -> Iterator[Any]:
        """Walk over the items, and count them."""
        with self:
            for item in self._items:
                yield item
                self.update()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the bar as it stands; a log keeps its lines."""
        if self._asked or self._bar is not None:
            self._draw()
        if self._bar is not None:
            self._bar.stop()

    def update(self, count: int = 1) -> None:
        """Count more items as done."""
        self._done += count
        now = time.monotonic()
        if self._off or now - self._told < (BETWEEN_LINES if self._lines else _BETWEEN_FRAMES):
            return
        self._told = now
        if self._lines:
            left = "?" if self._left is None else _clock(self._left)
            counted = f"{self._done} of {self._total or '?'}"
            spent = _clock(now - self._began)
            print(
                f"{self._desc}: {counted} after {spent}, {left} left", file=sys.stderr, flush=True
            )
        elif now - self._began >= self._delay:
            self._draw()

    def skip(self, count: int) -> None:
        """Count items as done that were done before, without letting them flatter the rate."""
        self._skipped += count
        self.update(count)

    @property
    def _pace(self) -> float:
        return (self._done - self._skipped) / max(time.monotonic() - self._began, 1e-9)

    @property
    def _left(self) -> float | None:
        return (self._total - self._done) / self._pace if self._total and self._pace else None

    def _draw(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
        from rich.progress import Progress as Bar

        left = "" if self._left is None else f"{_clock(self._left)} left, "
        words = f"{left}{self._pace:.3g}{self._unit}/s {self.note}"
        if self._bar is None:
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[words]}"),
            )
            # drawn here, by no thread of its own
            self._bar = Bar(*columns, console=Console(file=sys.stderr), auto_refresh=False)
            self._bar.add_task(self._desc, total=self._total, words=words)
            self._bar.start()
        task = self._bar.task_ids[0]
        self._bar.update(task, completed=self._done, words=words, refresh=True)


def _clock(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))
