"""The loops that several figures show, with the numbers that a reader changes in them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from simbench.detectors.errors import ParameterError, nearest
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import sampled_loop, ultimate_gain

if TYPE_CHECKING:
    import pandas as pd

# numbers of a loop as columns of a figure's table, with their units
COLUMNS = {
    "K": "K",
    "T": "T (s)",
    "Td": "Td (s)",
    "Kc": "Kc",
    "Ti": "Ti (s)",
    "Ts": "Ts (s)",
    "S": "S (%)",
    "J": "J (%)",
}
# ratios that set a number beside another: the number, and what it is a multiple of
_RATIOS = {"Td_over_T": ("Td", "T"), "Td_over_Ti": ("Td", "Ti"), "S_over_2J": ("J", "S")}
SETTABLE = tuple(COLUMNS) + tuple(_RATIOS)
_MOST_LISTED = 4  # different values of a number, beyond which the line shows their range


class Loops:
    """Loops of one figure, and what is changed in them.

    Parameters
    ----------
    changes : mapping of str to float, optional
        K, T, Td, Kc, Ti, Ts, S, J, or a ratio (Td_over_T, Td_over_Ti, S_over_2J), in place of the
        figure's own; a loop without the number stays as it is.
    """

    def __init__(self, changes: Mapping[str, float] | None = None) -> None:
        self.changes = dict(changes or {})
        for name, value in self.changes.items():
            if name not in SETTABLE:
                raise ParameterError(f"unknown number {name!r}: {nearest(name, SETTABLE)}")
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not number or not math.isfinite(value) or (value <= 0 and name not in ("Td", "J")):
                raise ParameterError(f"{name} = {value!r}; a number above 0 is needed")
        self.used: set[str] = set()
        self.retuned = 0  # loops whose Kc was lowered, as they would be unstable without friction
        self.last: dict[str, float] = {}  # the numbers that were given last, by column

    def numbers(self, **own: float | None) -> dict[str, float | None]:
        """Return a loop's numbers with the changes in them."""
        # A ratio changes what it is a ratio of
        numbers = {**own}
        for name, value in self.changes.items():
            if name in _RATIOS:
                target, base = _RATIOS[name]
                if numbers.get(target) is None or numbers.get(base) is None:
                    continue
                of = float(numbers[base] or 0.0)
                if name == "S_over_2J":
                    numbers[target] = of / (2.0 * value)
                else:
                    numbers[target] = value * of
            elif numbers.get(name) is not None:
                numbers[name] = float(value)
            else:
                continue
            self.used.add(name)

        # What the figure's table states
        self.last = {COLUMNS[k]: float(v) for k, v in numbers.items() if v is not None}
        return numbers

    def pi(self, *, numbers: Mapping[str, float | None], n: int | None = None, **more: Any) -> Loop:
        """Return a PI loop around a first-order plant with dead time, for `n` samples, and what
        else it has.

        `numbers` are K (1 when absent), T, Td, Kc, Ti, Ts and, of Choudhury's valve, S and J (% of
        travel); without T the plant integrates, without Ti the controller is P.
        """
        before = {"K": 1.0, **numbers}
        own = self.numbers(**before)
        loop = _loop_of(own, n, more)
        if not self.changes or not (gain := _beyond_margin(loop)):
            return loop
        Kc = loop.controller.Kc
        if "Kc" in self.changes:
            raise ParameterError(
                f"Kc = {Kc:g}: a loop of this figure (Td = {own['Td']:g} s) would be"
                f" unstable without friction; less than {Kc * gain:.3g} is needed"
            )
        self.retuned += 1

        # as far below the margin of stability as the figure's own loop
        before_margin = ultimate_gain(sampled_loop(_loop_of(before, n, {}))) or 1.0
        own["Kc"] = self.last[COLUMNS["Kc"]] = Kc * gain / before_margin
        return _loop_of(own, n, more)

    def told(self) -> str:
        """Return what was changed, and what followed from it, in sentences; "" where nothing
        was.
        """
        if not self.changes:
            return ""
        given = ", ".join(f"{name} = {value:g}" for name, value in self.changes.items())
        text = f"Drawn with {given} in place of the figure's own: what the book says of it need not"
        text += " hold."
        if not self.retuned:
            return text
        if self.retuned == 1:
            loops = "A loop"
        else:
            loops = f"{self.retuned} loops"
        return f"{text} {loops} would be unstable without friction: Kc was lowered there."

    def refuse_unused(self, figure: str) -> None:
        """Refuse a change that none of the figure's loops has."""
        for name in self.changes:
            if name not in self.used:
                raise ParameterError(
                    f"figure {figure} shows no loop with {name}, which cannot be set"
                )


def _loop_of(numbers: Mapping[str, Any], n: int | None, more: Mapping[str, Any]) -> Loop:
    if numbers.get("S") is None:
        valve = {}
    else:
        valve = {"valve": choudhury(numbers["S"], numbers["J"])}
    settings: dict[str, Any] = {}
    for k in ("K", "T", "Td", "Kc", "Ti", "Ts"):
        settings[k] = numbers.get(k)
    return pi_loop(**settings, n=n, **valve, **more)


def _beyond_margin(loop: Loop) -> float:
    """Return the factor on Kc at which a loop without friction begins to oscillate, where that is
    below 1; 0 of a stable loop.
    """
    gain = ultimate_gain(sampled_loop(loop)) or 0.0
    return gain if 0.0 < gain < 1.0 else 0.0


def pi_loop(
    *,
    K: float = 1.0,
    T: float | None = None,
    Td: float,
    Kc: float,
    Ti: float | None,
    Ts: float,
    n: int | None = None,
    **more: Any,
) -> Loop:
    """Return a PI loop around a first-order plant with dead time, for `n` samples, and what else it
    has; without T the plant integrates, without Ti the controller is P.
    """
    # Without T an integrator, without Ti a P controller
    if T is None:
        plant = {"type": "integrating"}
    else:
        plant = {"type": "foptd", "T": T}
    if Ti is None:
        controller = {"type": "P"}
    else:
        controller = {"type": "PI", "Ti": Ti}
    return Loop.from_table(
        {
            "plant": {**plant, "K": K, "Td": Td},
            "controller": {**controller, "Kc": Kc},
            "sampling": {"Ts": Ts} if n is None else {"Ts": Ts, "n": n},
            **more,
        }
    )


def choudhury(S: float | None, J: float | None) -> dict[str, Any]:
    """Return the table of a valve with stick band `S` and slip jump `J` (% of travel)."""
    return {"model": "choudhury", "S": S, "J": J}


def sine(amplitude: float, period: float) -> list[dict[str, Any]]:
    """Return the table of a sine (s) at the plant's output."""
    return [{"type": "sine", "amplitude": amplitude, "period": period, "at": "output"}]


def numbers_line(table: pd.DataFrame) -> str:
    """Return the numbers of the loops in a figure's table in one line, those that differ in the
    order of the loops; "" where it has none.

    >>> import pandas as pd
    >>> numbers_line(pd.DataFrame({"K": [1.0, 1.0], "Td (s)": [2.0, 4.0], "S (%)": [5.0, 5.0]}))
    'K = 1, Td = 2 / 4 s, S = 5 %'
    """
    # Each column that has numbers, with its different values
    parts = []
    for name, column in COLUMNS.items():
        if column not in table or table[column].dtype.kind not in "fiu":
            continue
        values = list(dict.fromkeys(table[column].dropna().map(lambda x: f"{x:.3g}")))
        if values:
            unit = column.removeprefix(name).strip(" ()")
            ends = sorted(values, key=float)
            few = len(values) <= _MOST_LISTED
            if few:
                shown = " / ".join(values)
            else:
                shown = f"{ends[0]} to {ends[-1]}"
            parts.append(f"{name} = {shown} {unit}".strip())
    return ", ".join(parts)
