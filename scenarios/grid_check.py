"""What a grid file must not say: every mistake that needs no simulation, found at once and before
the first one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from simbench.scenarios.cell import (
    ECHOES,
    EXCITATIONS,
    FOPTD_LAG,
    SAME,
    SETTINGS,
    TAG_WORDS,
    ULTIMATE,
)
from simbench.scenarios.errors import SpecError, suggestion

MOST_CELLS = 1_000_000  # of a grid that is run whole
MOST_DRAWN_FROM = 10**15  # of one from which scenarios are drawn: exact as floats
_MOST_BUILT = 2000  # cells that are built to see whether they make a loop
_SHOWN = 12  # mistakes in one sentence
# what a setting may be; 0 is allowed where the first number is
SETTING_LIMITS = {
    "Td_over_T": (0.0, 1e3),
    "Td_over_Ti": (0.0, 1e3),
    "S_over_2J": (1e-6, math.inf),
    "noise_ratio": (0.0, 1e3),
    "samples_per_period": (4.0, 1e4),
    "periods": (2.0, 1e4),
    "T": (1e-9, 1e9),
    "S": (1e-9, 100.0),
    "step": (0.0, 1e3),
    "speed": (1e-3, 1e3),
    "w_Ti": (1e-6, 1e6),
    "mv_noise": (0.0, 1e3),
    "warm_up": (0.0, 1e3),
    "op_rest": (0.0, 100.0),
    "moves": (0.0, 1e4),
    "move": (0.0, 1e3),
    "cut": (0.1, 1e9),
}
# of a grid, in a mistake's sentence
_PLACE = re.compile(r"\b(block|member) '[^']*': |\bcell \d+\b|(?<=\.)\d+(?=\.)")
_ATS = ("input", "output")


def refuse_mistakes(grid: Any, most_cells: int = MOST_CELLS) -> None:
    """Raise one error that names every mistake of a grid."""
    found = list(dict.fromkeys(_find_mistakes(grid.content)))
    if not found and grid.cells > most_cells:
        found = [
            f"{grid.cells:.3g} cells; at most {most_cells} are simulated, but `simbench run --n`"
            " draws scenarios from more"
        ]
    say(grid.name, found or _no_loops(grid))


def say(name: str, mistakes: list[str]) -> None:
    """Raise SpecError with all mistakes in one sentence, if there are any; one made in many places
    is told once.
    """
    places: dict[str, list[str]] = {}
    for mistake in mistakes:
        places.setdefault(_PLACE.sub("", mistake), []).append(mistake)
    told = []
    for many in places.values():
        told.append(f"{many[0]} (the same in {len(many) - 1} more)" if many[1:] else many[0])
    if told:
        if len(told) > _SHOWN:
            more = f"; and {len(told) - _SHOWN} more"
        else:
            more = ""
        raise SpecError(f"{name}: {'; '.join(told[:_SHOWN])}{more}")


def _find_mistakes(content: Any) -> Iterator[str]:
    # The names that each word may have
    known = {
        "disturbance": ("none", *content.disturbances),
        "effect": ("none", *content.effects),
        "process": ("foptd", "integrating"),
        "controller": ("PI", "P"),
        "tuning": tuple(FOPTD_LAG),
        "excitation": EXCITATIONS,
    }

    # The draws, and the numbers of loads and parts
    yield from _check_settings("[draw]", content.draw, known)
    for name, load in content.disturbances.items():
        where = f"disturbance {name!r}"
        if load.at not in _ATS:
            yield f"{where}: at = {load.at!r} is unknown, {suggestion(load.at, _ATS)}"
        for key, value in (
            ("amplitude", load.amplitude),
            ("period", load.period),
            *load.parameters.items(),
        ):
            yield from _check_range(f"{where}: {key}", value)
    for kind, parts in (("valve", content.valves), ("effect", content.effects)):
        for name, part in parts.items():
            for key, value in part.parameters.items():
                yield from _check_range(f"{kind} {name!r}: {key}", value)

    # A grid of one loop has axes only
    if content.loop is not None:
        axes = dict(content.axes)
        if "S_over_2J" in axes:  # of a whole loop, 0 is a healthy valve
            axes["S_over_2J"] = tuple(v for v in axes["S_over_2J"] if v != 0) or (1.0,)
        yield from _check_axes("", axes, {})
        return

    # Blocks: their names, their words, axes and draws
    for name, count in _count_names(b.name for b in content.block):
        if count > 1:
            yield f"{count} blocks are called {name!r}"
    for block in content.block:
        where = f"block {block.name!r}: "
        for key in ("process", "controller"):
            yield from _check_word(where + key, getattr(block, key), known[key])
        yield from _check_axes(where, block.axes, known)
        yield from _check_settings(f"{where}draw", block.draw, known)
        if not block.member:
            yield f"{where}it has no [[block.member]]; at least one is needed"

        # The members of a block
        for member in block.member:
            at = f"{where}member {member.name!r}: "
            words = {
                "tuning": (SAME,) + tuple(FOPTD_LAG) + tuple(ULTIMATE),
                "disturbance": known["disturbance"],
                "echo": ECHOES,
            }
            for key, names in words.items():
                yield from _check_names(at + key, getattr(member, key), names)
            yield from _check_names(at + "valve", member.valve, None)
            yield from _check_sibling(at, member, block)
            for key, values in member.where.items():
                for value in values:  # none is left where an axis was replaced
                    yield from _check_value(f"{at}where {key}", key, value, known)


def _check_sibling(at: str, member: Any, block: Any) -> Iterator[str]:
    """Where a member is an echo, the sticky member that it is one of must come before it."""
    if member.echo is None:
        return
    before = [m.name for m in block.member[: block.member.index(member)] if m.echo is None]
    if not before:
        yield f"{at}echo has no sibling; the sticky member must come first"
    elif member.of is not None:
        yield from _check_word(f"{at}of", member.of, tuple(before))


def _count_names(names: Iterable[str]) -> list[tuple[str, int]]:
    every = list(names)
    return [(name, every.count(name)) for name in dict.fromkeys(every)]


def _check_axes(where: str, axes: Mapping[str, tuple], known: Mapping[str, tuple]) -> Iterator[str]:
    for key, values in axes.items():
        yield from _check_axis(f"{where}axis {key!r}", key, values, known)
        twice = [v for v, count in _count_names(map(repr, values)) if count > 1]
        if twice:
            yield f"{where}axis {key!r} has the value {twice[0]} twice; each is allowed once"


def _check_axis(where: str, key: str, values: tuple, known: Mapping[str, tuple]) -> Iterator[str]:
    if not values:
        yield f"{where} has no value; at least one is needed"
    for value in values:
        yield from _check_value(where, key, value, known)


def _check_value(where: str, key: str, value: Any, known: Mapping[str, tuple]) -> Iterator[str]:
    if key not in SETTINGS:
        if isinstance(value, float) and math.isnan(value):
            yield f"{where} has the value nan; a number is needed"
    elif key in TAG_WORDS:
        if not isinstance(value, str):
            yield f"{where} has the value {value!r}; words are needed"
        elif key in known:
            yield from _check_word(where, value, known[key])
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        yield f"{where} has the value {value!r}; numbers are needed"
    else:
        yield from _check_limits(where, key, value)


def _check_limits(where: str, key: str, value: float) -> Iterator[str]:
    lo, hi = SETTING_LIMITS.get(key, (-1e60, 1e60))
    if not lo <= value <= hi:
        yield f"{where} has the value {value:g}; {lo:g} to {hi:g} is allowed"


def _check_settings(
    where: str, ranges: Mapping[str, Any], known: Mapping[str, tuple]
) -> Iterator[str]:
    # A setting of words takes words
    for key, value in ranges.items():
        place = f"{where} {key}"
        if key in TAG_WORDS:
            yield from (
                _check_names(place, value, known.get(key))
                if _is_words(value)
                else [f"{place} = {value!r}; words are needed"]
            )

        # A setting of numbers takes no word
        elif key in SETTINGS and (isinstance(value, str) or _is_words(value)):
            yield f"{place} = {value!r}; a number, or [lo, hi], is needed"
        else:
            yield from _check_range(place, value)
            for end in value if isinstance(value, tuple) else (value,):
                if key in SETTINGS and isinstance(end, (int, float)) and math.isfinite(end):
                    yield from _check_limits(place, key, end)


def _is_words(value: Any) -> bool:
    return isinstance(value, str) or (
        isinstance(value, tuple) and all(isinstance(v, str) for v in value)
    )


def _check_range(where: str, value: Any) -> Iterator[str]:
    """A fixed number, or (lo, hi), drawn evenly in logarithm."""
    # A single number is finite
    if isinstance(value, str):
        return
    if not isinstance(value, tuple):
        if not math.isfinite(value):
            yield f"{where} = {value:g}; a finite number is needed"
        return

    # Words need at least one
    if _is_words(value):
        if not value:
            yield f"{where} = []; a number, [lo, hi] or names are needed"
        return

    # A range is drawn evenly in logarithm
    lo, hi = value
    if not (0.0 < lo <= hi < math.inf):
        yield (
            f"{where} = [{lo:g}, {hi:g}]; 0 < lo <= hi is needed, as it is drawn evenly in"
            " logarithm"
        )


def _check_names(where: str, value: Any, known: tuple | None) -> Iterator[str]:
    if value is None:
        return
    if value in ((), ""):
        yield f"{where} has no name; at least one is needed"
    for name in (value,) if isinstance(value, str) else value:
        if known is not None:
            yield from _check_word(where, name, known)


def _check_word(where: str, value: str, known: tuple) -> Iterator[str]:
    if value not in known:
        yield f"{where} {value!r} is unknown, {suggestion(value, known)}"


def _no_loops(grid: Any) -> list[str]:
    """Build cells evenly over the grid, a few thousand at most; what they complain of, each
    complaint once.
    """
    found: dict[str, None] = {}
    for cell in range(0, grid.cells, max(1, grid.cells // _MOST_BUILT)):
        try:
            grid.group(cell)
        except SpecError as error:
            found[str(error).removeprefix(f"{grid.name}: ")] = None
        except (ArithmeticError, ValueError) as error:
            found[f"cell {cell} makes no loop: {error}"] = None
        if len(found) > _SHOWN:
            break
    return list(found)
