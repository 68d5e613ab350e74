"""What a plug-in part (valve, stage, disturbance, effect) may be told: its numbers with unit and
bounds, checked once.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from types import ModuleType
from typing import Any

from simbench.detectors.errors import ParameterError, UnknownName, nearest
from simbench.detectors.plugins.registry import PluginFolder
from simbench.detectors.record import LARGEST
from simbench.scenarios.plant import CONTROLLER_TYPES, PLANT_TYPES

VALVES = PluginFolder(
    "valve",
    "simbench.loop.valves",
    "simbench.valves",
    ("SOURCE", "FRICTION", "PARAMETERS", "start", "step"),
)
PLANT_PLUGINS = PluginFolder(
    "plant",
    "simbench.loop.plants",
    "simbench.plants",
    ("SOURCE", "INTEGRATING", "PARAMETERS", "start", "step"),
    PLANT_TYPES,
)
CONTROLLER_PLUGINS = PluginFolder(
    "controller",
    "simbench.loop.controllers",
    "simbench.controllers",
    ("SOURCE", "INTEGRAL", "PARAMETERS", "start", "step"),
    CONTROLLER_TYPES,
)

FOLLOWS = math.nan
"""Default of a number that follows from the others: the plug-in's `complete` fills it."""


@dataclass(frozen=True)
class Number:
    """A number with unit and bounds.

    Parameters
    ----------
    unit : str
        Unit, e.g. "% of travel", "s", "N"; "" for a ratio.
    low, high : float
        Smallest and largest allowed value.
    default : float, optional
        The value where none is given; None: it must be given. `FOLLOWS`: the plug-in's
        `complete` computes it from the others.
    says : str
        What it is, in a few words.
    positive : bool
        Refuse `low` itself: the value must be larger.
    identity : float
        Value at which an effect does nothing; the default where it is not given.
    """

    unit: str
    low: float = -math.inf
    high: float = math.inf
    default: float | None = None
    says: str = ""
    positive: bool = False
    identity: float = math.nan

    def __post_init__(self) -> None:
        if math.isnan(self.identity) and self.default is not None:
            object.__setattr__(self, "identity", self.default)

    def read(self, value: Any, name: str, where: str) -> float:
        """Return `value` as a float, or raise `ParameterError` with what is allowed.

        Parameters
        ----------
        value : object
            What was stated.
        name : str
            The parameter's name, for messages.
        where : str
            Where it stands, for messages.

        Returns
        -------
        float
            The value in the number's unit.
        """
        # A plain number in range needs no sentence
        if type(value) is float and self.low < value < self.high and -LARGEST <= value <= LARGEST:
            return value  # nearly always

        # What is allowed, in words
        if self.unit:
            unit = f" ({self.unit})"
        else:
            unit = ""
        allowed = f"it must be {self._allowed_range()}{unit}"

        # A number
        if isinstance(value, bool) or not hasattr(value, "__float__"):
            raise ParameterError(f"{where}: {name} = {value!r} is no number, {allowed}")
        try:
            number = float(value)
        except OverflowError:  # a whole number of hundreds of digits
            raise ParameterError(
                f"{where}: {name} = {_start_of_value(value)} is not finite, {allowed}"
            ) from None

        # Finite, and within its range
        if not math.isfinite(number):
            raise ParameterError(f"{where}: {name} = {number} is not finite, {allowed}")
        if abs(number) > LARGEST:
            raise ParameterError(
                f"{where}: {name} = {number:g} is out of range, it must be within"
                f" +-{LARGEST:g}{unit}"
            )
        if number < self.low or number > self.high or (self.positive and number == self.low):
            raise ParameterError(f"{where}: {name} = {number:g} is out of range, {allowed}")
        return number

    def _allowed_range(self) -> str:
        if math.isinf(self.low) and math.isinf(self.high):
            return f"within +-{LARGEST:g}"
        if math.isinf(self.high):
            return f"{'>' if self.positive else '>='} {self.low:g}"
        if math.isinf(self.low):
            return f"<= {self.high:g}"
        return f"in {self.low:g}..{self.high:g}" + (f", not {self.low:g}" if self.positive else "")


def _start_of_value(value: Any) -> str:
    try:
        return f"{str(value)[:60]}..."
    except ValueError:  # Python writes no whole number of more than 4300 digits out
        return "a number of thousands of digits"


@dataclass(frozen=True)
class Choice:
    """One of a few words; it arrives in the time step as its index, a float.

    Parameters
    ----------
    names : tuple of str
        The allowed words, in the order of their index.
    default : str, optional
        The word where none is given; None: it must be given.
    says : str
        What is chosen, in a few words.
    """

    names: tuple[str, ...]
    default: str | None = None
    says: str = ""

    def read(self, value: Any, name: str, where: str) -> float:
        """Return the index of the word `value`, or raise `ParameterError` with the nearest word.

        Parameters
        ----------
        value : object
            What was stated.
        name : str
            The parameter's name, for messages.
        where : str
            Where it stands, for messages.

        Returns
        -------
        float
            Its index among `names`.
        """
        if value not in self.names:
            raise ParameterError(
                f"{where}: {name} = {value!r} is unknown: {nearest(str(value), self.names)}"
            )
        return float(self.names.index(value))


_Schema = Mapping[str, Number | Choice]


def resolve(
    schema: _Schema,
    table: Mapping[str, Any],
    where: str,
    complete: Callable[[dict[str, float], str], dict[str, float]] | None = None,
    **extra: float,
) -> Any:
    """Check a table of numbers against a plug-in's schema; return a namedtuple of its fields in
    order, then those of `extra`.

    Missing keys take their default; `complete(values, where) -> values` fills the numbers that
    follow from others (they arrive as NaN). UnknownName for a key the schema lacks, ParameterError
    for a value that is missing, not finite, or out of range.
    """
    # No key but those of the schema
    if not table.keys() <= schema.keys():
        raise UnknownName(
            "parameter", next(name for name in table if name not in schema), schema, where
        )

    # Each value as stated, or its default
    values: dict[str, float] = {}
    for name, rule in schema.items():
        if name in table:
            values[name] = rule.read(table[name], name, where)
        elif rule.default is None:
            if isinstance(rule, Number) and rule.unit:
                unit = f" ({rule.unit})"
            else:
                unit = ""
            raise ParameterError(f"{where} needs {name}{unit}: {rule.says}")
        elif isinstance(rule, Choice):
            values[name] = rule.read(rule.default, name, where)
        else:
            values[name] = float(rule.default)

    # What follows from the others
    if complete is not None:
        values = complete(values, where)
    values.update(extra)
    return _parameter_class(tuple(values))._make(values.values())


def refuse_wrong_part(words: Mapping[str, tuple[Any, ...]], name: str, module: ModuleType) -> None:
    """Raise ParameterError for a part whose PARAMETERS are no table of numbers and choices, or that
    says of itself another word than those allowed.
    """
    rules = module.PARAMETERS
    known = isinstance(rules, dict) and all(isinstance(r, Number | Choice) for r in rules.values())
    if not known:
        raise ParameterError(
            f"{name!r}: PARAMETERS = {rules!r:.60}; a dict of Number and Choice is needed"
        )
    for word, allowed in words.items():
        if getattr(module, word) not in allowed:
            raise ParameterError(
                f"{name!r}: {word} = {getattr(module, word)!r}; allowed:"
                f" {', '.join(map(str, allowed))}"
            )


for _folder, _flag in (
    (VALVES, "FRICTION"),
    (PLANT_PLUGINS, "INTEGRATING"),
    (CONTROLLER_PLUGINS, "INTEGRAL"),
):
    _folder.refuse = partial(refuse_wrong_part, {_flag: (True, False)})


def valve_parameters(module: ModuleType, table: Mapping[str, Any], Ts: float) -> Any:
    """Resolve the parameters of one valve model or stage: what its `start` and `step` take as `p`,
    the sampling period last.
    """
    # a look into its namespace: asking a module for what it lacks raises an error inside, which
    # costs more than the numbers
    own = vars(module)
    p = resolve(
        own["PARAMETERS"], table, _valve_named(own["__name__"]), own.get("complete"), Ts=float(Ts)
    )
    if "check" in own:
        own["check"](p)
    return p


@cache
def _valve_named(module: str) -> str:
    return f"valve {module.rpartition('.')[2]!r}"


@cache
def _parameter_class(fields: tuple[str, ...]) -> type:
    """Return the one namedtuple class with these fields; its name spells them, so that pickle finds
    it again.
    """
    return namedtuple("P__" + "__".join(fields), fields, module=__name__)


def __getattr__(name: str) -> type:
    # pickle and numba's disk cache look parameter classes up by name in this module
    if name.startswith("P__"):
        return _parameter_class(tuple(name[3:].split("__")))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
