"""Row: one number or statement that the chapter prints, and what this code makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from simbench.detectors.record import LoopRecord
from simbench.figures._records import NeedsRecord, real_loop

Source = str | Path | None  # ISDB file or folder of real records


@dataclass(frozen=True)
class Row:
    """One published number."""

    place: str  # where the chapter prints it
    what: str  # quantity
    printed: str  # as printed
    ours: str  # from the code; "" when the data are not there
    agrees: bool | None  # whether it reproduces; None = cannot be tried
    why: str = ""  # what explains the difference, or how ours was obtained


def number(
    place: str,
    what: str,
    printed: float,
    ours: float,
    within: float,
    why: str = "",
    digits: int = 2,
) -> Row:
    """Return a row for a number that should agree within a tolerance; `digits` decimals are
    shown.
    """
    return Row(
        place,
        what,
        f"{printed:.{digits}f}",
        f"{ours:.{digits}f}",
        bool(abs(ours - printed) <= within),
        why,
    )


def loop(isdb: Source, name: str, **about: str) -> LoopRecord | None:
    """Return a real loop, or None where it is not at hand; arguments as
    `simbench.figures._records.real_loop`.
    """
    try:
        return None if isdb is None else real_loop(isdb, name, **about)
    except NeedsRecord:
        return None


def missing(place: str, what: str, printed: str, name: str) -> Row:
    """Return the row of a number whose record is not at hand; `name` is the loop."""
    return Row(
        place,
        what,
        printed,
        "",
        None,
        f"loop {name} is not among the records at hand; try `--isdb isdb10.mat`",
    )
