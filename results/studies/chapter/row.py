"""Row: one number or statement that the chapter prints, and what this code makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from detectors.record import LoopRecord
from simbench.figures._records import NeedsRecord, real_loop

Source = str | Path | None  # ISDB file or folder of real records


@dataclass(frozen=True)
class Row:
    """One published number.

    Parameters
    ----------
    place : str
        Where the chapter prints it.
    what : str
        Quantity.
    printed : str
        As printed.
    ours : str
        From the code; "" when the data are not there.
    agrees : bool or None
        Whether it reproduces; None = cannot be tried.
    why : str
        What explains the difference, or how ours was obtained.
    """

    place: str
    what: str
    printed: str
    ours: str
    agrees: bool | None
    why: str = ""


def number(place: str, what: str, printed: float, ours: float, within: float, why: str = "", digits: int = 2) -> Row:
    """Return a row for a number that should agree within a tolerance.

    Parameters
    ----------
    place, what, why : str
        As in `Row`.
    printed, ours : float
        The two values.
    within : float
        Largest difference that still reproduces.
    digits : int
        Decimals shown.

    Returns
    -------
    Row

    Examples
    --------
    >>> number("Example 11.1", "rho1", 0.48, 0.487, 0.01).agrees
    True
    """
    return Row(place, what, f"{printed:.{digits}f}", f"{ours:.{digits}f}", bool(abs(ours - printed) <= within), why)


def loop(isdb: Source, name: str, **about: str) -> LoopRecord | None:
    """Return a real loop, or None where it is not at hand; arguments as `simbench.figures._records.real_loop`."""
    try:
        return None if isdb is None else real_loop(isdb, name, **about)
    except NeedsRecord:
        return None


def missing(place: str, what: str, printed: str, name: str) -> Row:
    """Return the row of a number whose record is not at hand; `name` is the loop."""
    return Row(place, what, printed, "", None, f"loop {name} is not among the records at hand; try `--isdb isdb10.mat`")
