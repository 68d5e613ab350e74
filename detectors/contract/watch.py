"""Call a function of a plug-in and record its side effects: exceptions, warnings, printed text, and
changes to its input.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from typing import Any

from simbench.detectors.errors import UserError


@dataclass
class Guarded:
    """What a call to a plug-in returned, and what it did besides."""

    value: Any = None
    refusal: UserError | None = None
    faults: list[str] = field(default_factory=list)

    def at(self, where: str) -> list[str]:
        """Return what it did besides answering, each with where that was."""
        return [f"{fault}, {where}" for fault in self.faults]

    def unanswered(self) -> list[str]:
        """Return why there is no answer, a refusal too, where one is due."""
        return self.faults or ([f"refuses ({self.refusal})"] if self.refusal else [])


def call_guarded(work: Callable[[], Any]) -> Guarded:
    """Call a plug-in and note what no plug-in may do: raise, warn or print."""
    guarded = Guarded()
    printed = io.StringIO()
    with (
        warnings.catch_warnings(record=True) as warned,
        redirect_stdout(printed),
        redirect_stderr(printed),
    ):
        warnings.simplefilter("always")
        try:
            guarded.value = work()
        except UserError as error:
            guarded.refusal = error
        except (Exception, SystemExit) as error:  # a plug-in may fail in any way
            text = str(error)
            written = "read-only" in text
            guarded.faults.append(
                f"writes into what it was given ({text})"
                if written
                else f"raises {type(error).__name__} ({text})"
            )
    if printed.getvalue().strip():
        guarded.faults.append(f"prints {printed.getvalue().strip().splitlines()[0]!r}")
    guarded.faults += sorted({f"warns: {w.category.__name__}, {w.message}" for w in warned})
    return guarded
