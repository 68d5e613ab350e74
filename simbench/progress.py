"""Show the progress of long work on stderr: a bar on a terminal, at most one line a minute
elsewhere.
"""

from __future__ import annotations

import sys
from typing import Any

from tqdm import tqdm

_LINE = "{desc}: {n_fmt} of {total_fmt} after {elapsed}, {remaining} left"
BETWEEN_LINES = 60.0  # s, between two lines in a log


class Progress(tqdm):
    """A tqdm bar that writes whole lines where stderr is no terminal, unless a `bar` is asked
    for.
    """

    def __init__(self, *given: Any, bar: bool = False, delay: float = 0.0, **more: Any) -> None:
        self._lines = not (bar or sys.stderr.isatty())
        if self._lines:
            delay, more = BETWEEN_LINES, {**more, "mininterval": BETWEEN_LINES, "miniters": 1}
        super().__init__(*given, file=sys.stderr, delay=delay, **more)

    def display(self, msg: str | None = None, pos: int | None = None) -> Any:
        """Draw the bar, or write its line."""
        if not self._lines:
            return super().display(msg, pos)
        print(
            self.format_meter(**{**self.format_dict, "ncols": None, "bar_format": _LINE}),
            file=sys.stderr,
            flush=True,
        )
        return True

    def close(self) -> None:
        """Take the bar away; a log keeps its lines."""
        if self._lines:
            self.disable = True
        super().close()
