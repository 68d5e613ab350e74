"""The schema of one loop and of one labelled scenario: pure numbers and names, checked when
read.
"""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from datetime import date, time
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_serializer,
    model_validator,
)

from simbench.scenarios.columns import with_columns
from simbench.scenarios.errors import SpecError, suggestion
from simbench.scenarios.polynomials import checked_polynomials, checked_sampled, integrates

MAX_SAMPLES = 20_000_000  # a run holds about ten arrays of n doubles: 1.6 GB here
_MOST_CLAUSES = 12  # complaints in one sentence
LARGEST_NUMBER = 1e60  # beyond it a record's statistics leave the range of double numbers
M = TypeVar("M", bound=BaseModel)
Value = float | int | str | bool | list[Any] | dict[str, Any]


def _number(value: Any) -> Any:
    if isinstance(value, (bool, str)):  # which would be read as 1.0, or as the number it spells
        raise ValueError("a number is needed")
    return value


Real = Annotated[float, BeforeValidator(_number)]
Whole = Annotated[int, BeforeValidator(_number)]
_Finite = Annotated[Real, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
_Positive = Annotated[Real, Field(gt=0, le=LARGEST_NUMBER, allow_inf_nan=False)]
_Flag = Annotated[Whole, Field(ge=0, le=1)]
_NonNegative = Annotated[Real, Field(ge=0, le=LARGEST_NUMBER, allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants")

    def replace(self, **changes: Any) -> Self:
        """Return the table with some of its fields changed; every rule of it is checked again.

        Parameters
        ----------
        **changes
            New values by field, as a loop file has them or as the objects that they become.

        Returns
        -------
        table of the same class
            A new one; this one stays as it is.

        Raises
        ------
        SpecError
            As `Loop.from_table`.
        """
        return checked(type(self), {**self._kept(), **changes}, type(self).__name__.lower())

    def _kept(self) -> dict[str, Any]:
        """Return the fields that are set, without what follows from others."""
        return self.model_dump(exclude_none=True)


class Plant(_Table):
    """G(s) between valve and PV: K e^(-Td s)/(T s + 1), K e^(-Td s)/s, num(s)/den(s) e^(-Td s), or
    a plug-in's.

    K in PV units per % (integrating: per % and s), T and Td in s; `num` and `den` in falling powers
    of s, or with `dt`, the sampling period, of z: what the samples of PV do under held samples of
    MV. Of a "tf" plant K follows, and T where it is of first order; `parameters` are those of a
    plug-in, whose K and T count where it has them.
    """

    type: str
    K: _Finite
    T: _Positive | None = None
    Td: _NonNegative = 0.0
    num: tuple[_Finite, ...] | None = None
    den: tuple[_Finite, ...] | None = None
    dt: _Positive | None = None
    parameters: dict[str, Value] | None = None

    @model_validator(mode="before")
    @classmethod
    def _read_table(cls, table: Any) -> Any:
        if not isinstance(table, dict) or not isinstance(table.get("type"), str):
            return table
        if table["type"] == "tf":
            return _read_tf(table) if table.get("dt") is None else _read_sampled(table)
        if table["type"] not in PLANT_TYPES:
            _refuse_misspelt(table["type"], PLANT_TYPES)
            return _read_plugin(table, ("type", "Td"), {"K": 1.0})
        return table

    @model_validator(mode="after")
    def _check_whole(self) -> Self:
        if self.K == 0:
            raise ValueError("K = 0; the valve must act on PV")
        for name in ("num", "den", "dt"):
            if self.type in ("foptd", "integrating") and getattr(self, name) is not None:
                raise ValueError(
                    f"{name} belongs to a plant of type 'tf'; {self.type} needs"
                    f" K{', T' * (self.type == 'foptd')}"
                )
        if self.dt is not None and abs(self.Td / self.dt - round(self.Td / self.dt)) > _SAME_DT:
            raise ValueError(
                f"Td = {self.Td:g} s is no whole number of samples of dt = {self.dt:g} s, which a"
                " plant in powers of z needs"
            )
        if self.type == "foptd" and self.T is None:
            raise ValueError("T is missing; foptd needs a time constant above 0 s")
        if self.type == "integrating" and self.T is not None:
            raise ValueError(
                f"T = {self.T}; an integrating plant has no time constant, no T is needed"
            )
        return self

    @model_serializer(mode="wrap")
    def _write(self, handler: Any) -> dict[str, Any]:
        return _flat(
            handler(self),
            {"tf": ("K", "T")}.get(self.type, ()) if self.parameters is None else ("K", "T"),
        )

    @property
    def integrating(self) -> bool:
        """Whether the plant integrates; a plug-in's own file says so, not its loop."""
        if self.den is None:
            return self.type == "integrating"
        return self.den[-1] == 0.0 if self.dt is None else integrates(self.den)

    def with_gain(self, factor: float) -> Plant:
        """Return the plant behind which PV moves by `factor` times as much; a plug-in without a K
        stays.
        """
        scaled: dict[str, Any] = {"K": self.K * factor}
        if self.num is not None:
            scaled["num"] = tuple(x * factor for x in self.num)
        if self.parameters is not None and self.known_gain:
            scaled["parameters"] = {**self.parameters, "K": self.K * factor}
        return self.model_copy(update=scaled)

    @property
    def known_gain(self) -> bool:
        """Whether K is the plant's own, and not a stand-in for a plug-in that has none."""
        return self.parameters is None or "K" in self.parameters


class Controller(_Table):
    """PI, P, PID or "tf": Kc in % per PV unit, times in s; "reverse" raises OP when PV falls. Other
    types are plug-ins.

    "tf": OP answers to the error by `num` over `den` in falling powers of z, with `dt` the sampling
    period; the law goes on from the limited OP, which is its anti-windup.

    PID: Td of the derivative, filtered with Td/N; weights b and c of SP in its P and D part;
    `form`; `anti_windup` with its tracking time Tt; `schedule` = [[value, factor on Kc], ...] over
    `schedule_on`, straight between.
    """

    type: str
    Kc: _Positive
    Ti: _Positive | None = None
    direction: Literal["reverse", "direct"] = "reverse"
    Td: _NonNegative | None = None
    N: _Positive | None = None
    form: Literal["positional", "velocity"] | None = None
    b: _NonNegative | None = None
    c: _NonNegative | None = None
    anti_windup: Literal["clamping", "back-calculation"] | None = None
    Tt: _Positive | None = None
    schedule: tuple[tuple[_Finite, _Positive], ...] | None = None
    schedule_on: Literal["pv", "op", "sp"] | None = None
    num: tuple[_Finite, ...] | None = None
    den: tuple[_Finite, ...] | None = None
    dt: _Positive | None = None
    parameters: dict[str, Value] | None = None

    @model_validator(mode="before")
    @classmethod
    def _read_table(cls, table: Any) -> Any:
        if not isinstance(table, dict) or not isinstance(table.get("type"), str):
            return table
        if table["type"] == "tf":
            return _read_law(table)
        if table["type"] in CONTROLLER_TYPES:
            return table
        _refuse_misspelt(table["type"], CONTROLLER_TYPES)
        return _read_plugin(table, ("type", "direction"), {"Kc": 1.0})

    @model_validator(mode="after")
    def _check_whole(self) -> Self:
        if self.type in ("PI", "PID") and self.Ti is None:
            raise ValueError(
                f"Ti is missing; a {self.type} controller needs an integral time above 0 s"
            )
        if self.type == "P" and self.Ti is not None:
            raise ValueError(f"Ti = {self.Ti}; a P controller has none, no Ti is needed")
        for name in ("num", "den", "dt") if self.type in ("P", "PI", "PID") else ():
            if getattr(self, name) is not None:
                raise ValueError(f"{name} belongs to a controller of type 'tf'")
        for name in _OF_PID if self.type in ("P", "PI") else ():
            if getattr(self, name) is not None:
                raise ValueError(
                    f"{name} = {getattr(self, name)}; a {self.type} controller has none, type 'PID'"
                    " is needed"
                )
        points = [x for x, _ in self.schedule or ()]
        if self.schedule is not None and (not points or points != sorted(set(points))):
            raise ValueError("schedule needs [[value, factor], ...] with rising values")
        if self.schedule_on is not None and self.schedule is None:
            raise ValueError(
                f"schedule_on = {self.schedule_on!r} without a schedule; [[value, factor], ...] is"
                " needed"
            )
        return self

    @model_serializer(mode="wrap")
    def _write(self, handler: Any) -> dict[str, Any]:
        own = self.parameters is not None or self.type == "tf"
        return _flat(handler(self), ("Kc", "Ti") if own else ())

    @property
    def sign(self) -> float:
        """+1 for "reverse", -1 for "direct"."""
        return 1.0 if self.direction == "reverse" else -1.0


PLANT_TYPES = ("foptd", "integrating", "tf")
CONTROLLER_TYPES = ("PI", "P", "PID", "tf")
_SAME_DT = 1e-6  # of a sample, by which a dead time in whole samples, or dt and Ts, may differ
_OF_PID = ("Td", "N", "form", "b", "c", "anti_windup", "Tt", "schedule", "schedule_on")


def _refuse_misspelt(word: str, known: tuple[str, ...]) -> None:
    """Refuse the letters of a built-in type in another order or case: no plug-in's name, but a
    slip.
    """
    near = [k for k in known if sorted(k.lower()) == sorted(word.lower())]
    if near:
        raise ValueError(f"type = {word!r} is unknown; did you mean {near[0]!r}?")


def _read_tf(table: dict[str, Any]) -> dict[str, Any]:
    """Return a table of num and den with the K, and of a first-order plant the T, that follow from
    them.
    """
    given = [name for name in ("K", "T") if table.get(name) is not None]
    if given:
        raise ValueError(
            f"{given[0]} = {table[given[0]]}; a plant of type 'tf' has num, den and Td"
        )
    _refuse_missing(table, "plant", "s")
    num, den = checked_polynomials(table["num"], table["den"])
    order = den.size - 1
    integrating = den[-1] == 0.0
    K = float(num[-1] / den[-2 if integrating else -1])
    T = {"T": float(den[0] / den[1])} if order == 1 and not integrating else {}
    return {**table, "num": num.tolist(), "den": den.tolist(), "K": K, **T}


def _read_sampled(table: dict[str, Any]) -> dict[str, Any]:
    """Return a table of num and den in powers of z with the K, and of a first-order plant the T,
    that follow from them.
    """
    _refuse_missing(table, "plant", "z")
    num, den = checked_sampled(table["num"], table["den"], 1)
    # without its pole at z = 1, an integrating plant's gain is that of the slope
    rest = np.cumsum(den)[:-1] * float(table["dt"]) if integrates(den.tolist()) else den
    K = float(num.sum() / rest.sum())
    T = {"T": float(-table["dt"] / math.log(-den[1]))} if den.size == 2 and 0 < -den[1] < 1 else {}
    return {**table, "num": num.tolist(), "den": den.tolist(), "K": K, **T}


def _read_law(table: dict[str, Any]) -> dict[str, Any]:
    """Return the table of a controller by num and den in powers of z, both as long; its gain is
    theirs.
    """
    odd = sorted(table.keys() - {"type", "num", "den", "dt", "direction", "parameters"})
    if any(table[name] is not None for name in odd):
        raise ValueError(f"{odd[0]}: a controller of type 'tf' has num, den, dt and direction")
    _refuse_missing(table, "controller", "z")
    if table.get("dt") is None:
        raise ValueError("dt is missing; a controller of type 'tf' needs the sampling period in s")
    num, den = checked_sampled(table["num"], table["den"], 0)
    return {**table, "num": num.tolist(), "den": den.tolist(), "Kc": 1.0}


def _refuse_missing(table: dict[str, Any], part: str, power: str) -> None:
    for name in ("num", "den"):
        if table.get(name) is None:
            raise ValueError(
                f"{name} is missing; a {part} of type 'tf' needs num and den, numbers in falling"
                f" powers of {power}"
            )


def _read_plugin(
    table: dict[str, Any], common: tuple[str, ...], default: dict[str, float]
) -> dict[str, Any]:
    """Return the table of a plug-in with its own parameters apart; what they share with the
    built-in parts counts as theirs.
    """
    own = {k: v for k, v in table.items() if k not in (*common, "parameters")}
    own.update(table.get("parameters") or {})
    wanted = ("K", "T") if "K" in default else ("Kc", "Ti")
    known = {
        k: own[k]
        for k in wanted
        if isinstance(own.get(k), (int, float)) and not isinstance(own[k], bool) and own[k]
    }
    return {**{k: table[k] for k in common if k in table}, **default, **known, "parameters": own}


def _flat(table: dict[str, Any], follow: tuple[str, ...]) -> dict[str, Any]:
    """Return a part's table as a file writes it: without what follows, a plug-in's parameters among
    the rest.
    """
    own = table.pop("parameters", None) or {}
    return {**{k: v for k, v in table.items() if k not in follow and v is not None}, **own}


class OperatingPoint(_Table):
    """Where the run rests before it starts: OP in %, PV in its units (None: the set point's start
    value).
    """

    op0: Annotated[Real, Field(ge=0, le=100, allow_inf_nan=False)] = 50.0
    pv0: _Finite | None = None


class Sampling(_Table):
    """Ts in s; n samples of the record; `warm_up` samples are simulated before it and dropped.

    The run starts in equilibrium, at the first sample of the warm-up: times of loads and set-point
    steps count from there.
    """

    Ts: _Positive
    n: Annotated[Whole, Field(ge=3, le=MAX_SAMPLES)] = 4000
    warm_up: Annotated[Whole, Field(ge=0, le=MAX_SAMPLES)] | None = None


class Noise(_Table):
    """White measurement noise: std on PV (PV units), which the controller sees, mv_std on the
    recorded MV alone (%).
    """

    std: _NonNegative = 0.0
    mv_std: _NonNegative | None = None


class Archiving(_Table):
    """What is done to the samples on their way to the record, which the controller does not see:
    OP (%) and PV written in steps, and their last value repeated where `op_held` or `pv_held` is 1.

    `op_held` and `pv_held` are lists of 0 and 1, one a sample, begun again where the record is
    longer, or the columns of these names in `file`, a CSV file beside the loop file.
    """

    op_step: _NonNegative = 0.0
    pv_step: _NonNegative = 0.0
    op_held: tuple[_Flag, ...] | None = None
    pv_held: tuple[_Flag, ...] | None = None


class SetPoint(_Table):
    """Start value and later steps [[t in s, new value], ...]."""

    value: _Finite = 50.0
    steps: tuple[tuple[_NonNegative, _Finite], ...] = ()


class Outer(_Table):
    """The outer loop of a cascade: its OP, 0..100 % over `sp_span`, is the set point of the loop
    that has the valve.

    Its plant leads from that loop's PV to its own; both are sampled together.
    """

    plant: Plant
    controller: Controller
    setpoint: SetPoint = SetPoint()
    noise: Noise = Noise()
    sp_span: tuple[_Finite, _Finite] = (0.0, 100.0)

    @model_validator(mode="after")
    def _check_feedback(self) -> Self:
        if self.plant.type not in PLANT_TYPES or self.controller.type not in CONTROLLER_TYPES:
            kinds = f"plants {', '.join(PLANT_TYPES)} and controllers {', '.join(CONTROLLER_TYPES)}"
            raise ValueError(f"an outer loop takes no plug-in; {kinds} are allowed")
        if self.plant.dt or self.controller.dt:
            raise ValueError("an outer loop takes no part in powers of z; one in s is needed")
        if not self.sp_span[0] < self.sp_span[1]:
            raise ValueError(
                f"sp_span = {list(self.sp_span)}; the set points at 0 and 100 % are needed, rising"
            )
        if self.controller.sign * self.plant.K < 0:
            raise ValueError(
                f"positive feedback: outer plant K = {self.plant.K} under direction"
                f" {self.controller.direction!r}"
            )
        return self


class Part(BaseModel):
    """A plug-in (valve, disturbance, effect) as its name and its table of numbers; its own file
    checks the numbers.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants")
    name: str
    parameters: dict[str, Value] = Field(default_factory=dict)

    @classmethod
    def of(cls, section: str, table: Mapping[str, Any]) -> Self:
        """Return the part that a table of a loop file's section names, its numbers beside it."""
        key = _NAME_KEY[section]
        return cls(name=table[key], parameters={k: v for k, v in table.items() if k != key})


# The key that names the plug-in in each table of a loop file.
_NAME_KEY = {"valve": "model", "disturbance": "type", "effect": "name"}


class Loop(_Table):
    """One control loop, complete: a run is a function of this and a seed.

    Parameters
    ----------
    plant, controller, sampling : table
        As in a loop file.
    operating_point : table, optional
        As in a loop file.
    valve : Part
        The valve model; ideal when absent.
    noise, setpoint, archive : table, optional
        As in a loop file.
    disturbance, effect : tuple of Part
        What acts on the loop or its record.
    outer : Outer, optional
        The outer loop of a cascade, whose OP is this loop's set point.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    ...     "valve": {"model": "choudhury", "S": 5, "J": 2},
    ...     "sampling": {"Ts": 1}})
    >>> loop.with_("valve.S", 3.0).valve.parameters["S"]
    3.0
    """

    plant: Plant
    controller: Controller
    sampling: Sampling
    operating_point: OperatingPoint = OperatingPoint()
    valve: Part = Part(name="ideal")
    noise: Noise = Noise()
    setpoint: SetPoint = SetPoint()
    archive: Archiving | None = None
    disturbance: tuple[Part, ...] = ()
    effect: tuple[Part, ...] = ()
    outer: Outer | None = None

    @model_validator(mode="after")
    def _inner(self) -> Self:
        if self.outer is None:
            return self
        if self.setpoint.steps:
            raise ValueError(
                "setpoint.steps: the set point of an inner loop is the outer OP; steps belong to"
                " [outer.setpoint]"
            )
        lo, hi = self.outer.sp_span
        if not lo <= self.pv0 <= hi:
            raise ValueError(
                f"PV rests at {self.pv0:g}, which the outer OP cannot ask for: sp_span = [{lo:g},"
                f" {hi:g}]"
            )
        return self

    @model_validator(mode="after")
    def _negative_feedback(self) -> Self:
        if self.controller.type == "tf":
            # the sign of its gain is that of its num, which may change with the frequency
            return self
        if self.plant.known_gain and self.controller.sign * self.plant.K < 0:
            raise ValueError(
                f"positive feedback: plant K = {self.plant.K} needs controller direction"
                f" {'direct' if self.plant.K < 0 else 'reverse'!r}, not"
                f" {self.controller.direction!r}"
            )
        return self

    @model_validator(mode="after")
    def _numbers_that_can_be_sampled(self) -> Self:
        K = self.plant.K
        T = self.plant.T
        Ts = self.sampling.Ts
        if T is not None and math.isinf(abs(K) / T + Ts / T):
            raise ValueError(
                f"T = {T:g} s is too small for K = {K:g} and Ts = {Ts:g} s: K/T and Ts/T must be"
                " finite numbers"
            )
        return self

    @model_validator(mode="after")
    def _parts_of_one_pace(self) -> Self:
        for name, dt in (("plant", self.plant.dt), ("controller", self.controller.dt)):
            if dt is not None and abs(dt / self.sampling.Ts - 1.0) > _SAME_DT:
                raise ValueError(
                    f"{name}.dt = {dt:g} s; the sampling period, Ts = {self.sampling.Ts:g} s, is"
                    " needed"
                )
        return self

    @model_validator(mode="after")
    def _delay_that_fits(self) -> Self:
        Td = self.plant.Td
        Ts = self.sampling.Ts
        if Td > MAX_SAMPLES * Ts:
            raise ValueError(
                f"Td = {Td:g} s is {Td / Ts:.3g} samples of Ts = {Ts:g} s; at most {MAX_SAMPLES}"
                " are simulated"
            )
        return self

    def _kept(self) -> dict[str, Any]:
        """Return the sections as the objects that they are, which need no second check."""
        return {name: section for name, section in self if section is not None}

    @property
    def pv0(self) -> float:
        """PV at rest, in its units."""
        pv0 = self.operating_point.pv0
        return self.setpoint.value if pv0 is None else pv0

    @classmethod
    def from_table(cls, table: dict[str, Any], where: str = "loop") -> Self:
        """Check a nested table, as TOML gives it, and return the loop.

        Parameters
        ----------
        table : dict
            Keys of the loop file.
        where : str
            File name for messages.

        Returns
        -------
        Loop
            The loop, every value of it checked.

        Raises
        ------
        SpecError
            One sentence: the key, its value, what is allowed, the nearest known key.
        """
        table = with_columns(table, Path(), where)
        for section, key in _NAME_KEY.items():
            if section in table:
                many = section != "valve"
                parts = table[section] if many else [table[section]]
                if not isinstance(parts, (list, tuple)):
                    raise SpecError(f"{where}: [{section}] must be written [[{section}]]")
                named = [_part(p, section, key, where) for p in parts]
                table[section] = named if many else named[0]
        return checked(cls, table, where)

    def to_table(self) -> dict[str, Any]:
        """Return the loop as the nested table that `from_table` reads.

        Returns
        -------
        dict
            Section to its keys and values; lists of tables for disturbance and effect.
        """
        table = self.model_dump(exclude_none=True)
        for section, key in _NAME_KEY.items():
            parts = [{key: p.name, **p.parameters} for p in _parts(getattr(self, section))]
            table[section] = parts[0] if section == "valve" else parts
        return table

    def to_toml(self) -> str:
        """Return the loop as the text of a loop file.

        Returns
        -------
        str
            TOML that `load_loop` reads as the same loop.
        """
        return toml_of(self.to_table())

    def with_(self, key: str, value: Any) -> Self:
        """Return the loop with one dotted key changed, e.g. "controller.Kc" or "valve.S".

        Parameters
        ----------
        key : str
            section.name.
        value : object
            The new value, as a loop file has it.

        Returns
        -------
        Loop
            A new loop; this one stays as it is.

        Raises
        ------
        SpecError
            For a key that the loop file does not have, or a value it does not allow.
        """
        return self.with_all({key: value})

    def with_all(self, changes: Mapping[str, Any]) -> Self:
        """Return the loop with several keys changed at once: dotted ones, and sections as a whole,
        which come first.

        Parameters
        ----------
        changes : mapping of str to value
            section.name, or a section with its table (a list of tables for disturbance and effect).

        Returns
        -------
        Loop
            A new loop; this one stays as it is.

        Raises
        ------
        SpecError
            As `with_`.
        """
        if not changes:
            return self
        table = self.to_table()
        for key, value in sorted(changes.items(), key=lambda change: "." in change[0]):
            section, dot, name = key.partition(".")
            if (
                section not in Loop.model_fields
                or (dot and not name)
                or not (name or isinstance(value, (dict, list, tuple)))
            ):
                raise SpecError(_no_key(key, value))
            if not name:
                table[section] = value
                continue
            if isinstance(table.get(section), list):
                raise SpecError(
                    f"key {key!r}: [[{section}]] is a list and cannot be set by name; {section} ="
                    " [...] sets it whole"
                )
            table[section] = {**table.get(section, {}), name: value}
        return type(self).from_table(
            table, f"with {', '.join(f'{key} = {value}' for key, value in changes.items())}"
        )


def toml_of(table: Mapping[str, Any]) -> str:
    """Return a loop's table as the text of a loop file."""
    lines = []
    for section, content in table.items():
        for part in content if isinstance(content, list) else [content]:
            lines.append(f"[[{section}]]" if isinstance(content, list) else f"[{section}]")
            lines += [f"{key} = {_toml_value(value)}" for key, value in part.items()]
            lines.append("")
    return "\n".join(lines)


def _no_key(key: str, value: Any) -> str:
    """Return why a key names nothing of a loop, and what is meant."""
    section, dot, _ = key.partition(".")
    if section not in Loop.model_fields:
        near = suggestion(section, Loop.model_fields)
        form = "" if dot else "; section.name is needed, such as valve.S"
        return f"unknown key {key!r}: no section {section!r}, {near}{form}"
    if dot:
        return f"key {key!r} names section {section} and no key of it; section.name is needed"
    fields = getattr(Loop.model_fields[section].annotation, "model_fields", {})
    names = [f"{section}.{name}" for name in fields if section != "valve"] or [f"{section}.S"]
    return (
        f"key {key!r} = {value!r} is a section: a table is needed, or a key of it, such as"
        f" {names[0]}"
    )


class Scenario(_Table):
    """A loop, a seed, and tags that place it in its grid.

    Parameters
    ----------
    loop : Loop
        What is simulated.
    seed : int
        Root of its random streams.
    tags : dict
        Axis values of its cell.
    asked : str, optional
        Its id in a grid, a hash of what the grid asks for and of no computed number.
    """

    loop: Loop
    seed: Annotated[int, Field(ge=0)] = 0
    tags: dict[str, float | int | str | None] = Field(default_factory=dict)
    asked: str | None = None

    @property
    def id(self) -> str:
        """The join key of every table; outside a grid, what was asked for is the loop itself."""
        return self.asked or self.loop_digest

    @cached_property
    def loop_digest(self) -> str:
        """Hash of loop and seed, of which the record is a function."""
        return content_hash({"loop": self.loop.to_table(), "seed": str(self.seed)})


def load_loop(path: str | Path) -> Loop:
    """Read a loop file.

    Parameters
    ----------
    path : str or Path
        TOML as in the contract, section 3.

    Returns
    -------
    Loop
        The loop, every value of it checked.

    Raises
    ------
    SpecError
        When the file is missing, is no TOML (with the line), or asks for something impossible.
    """
    return Loop.from_table(read_loop(path), str(path))


def read_loop(path: str | Path) -> dict[str, Any]:
    """Read the table of a loop file, with the columns of the files that it names."""
    return with_columns(read_toml(path), Path(path).parent, str(path))


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file or say in one sentence why not."""
    # a pipe would be waited for
    if (file := Path(path)).exists() and not file.is_file() and not file.is_dir():
        raise SpecError(f"{path} is no file; a TOML file is needed")
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise SpecError(f"{path} is a folder; a TOML file is needed") from None
    except UnicodeDecodeError:
        raise SpecError(f"{path} is no UTF-8 text; a TOML file is needed") from None
    except OSError as error:
        raise SpecError(f"{path} cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise SpecError(
            f"{path} is no valid TOML: {error}; lines of NAME = VALUE and [SECTION] are needed"
        ) from None
    except RecursionError:
        raise SpecError(
            f"{path} cannot be read: its values are nested too deeply; some ten levels are allowed"
        ) from None
    except ValueError:  # Python's own limit on whole numbers
        raise SpecError(
            f"{path} cannot be read: it holds a number of more than 4300 digits; shorter ones are"
            " needed"
        ) from None


def checked(model: type[M], table: dict[str, Any], where: str) -> M:
    """Validate a table against a model; all complaints become one sentence."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise SpecError(f"{where}: {_sentences(model, error.errors(), table)}") from None
    except RecursionError:
        raise SpecError(
            f"{where}: its values are nested too deeply; some ten levels are allowed"
        ) from None


def content_hash(content: Any) -> str:
    """Return 16 hex digits that identify a nested table of numbers and names."""
    text = json.dumps(_canonical(content), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _toml_value(value: Any) -> str:
    """Write one value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return repr(value)


def _canonical(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _canonical(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_canonical(v) for v in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return repr(float(value))
    return value


def _parts(value: Part | tuple[Part, ...]) -> tuple[Part, ...]:
    return (value,) if isinstance(value, Part) else value


def _part(table: Any, section: str, key: str, where: str) -> dict[str, Any]:
    if isinstance(table, Part):
        return table.model_dump()
    if not isinstance(table, dict) or key not in table:
        have = sorted(table) if isinstance(table, dict) else []
        wrong = f" (found {', '.join(have)})" if have else ""
        raise SpecError(f"{where}: [{section}] lacks the key {key!r}, which is needed{wrong}")
    parameters = {k: v for k, v in table.items() if k != key}
    return {"name": table[key], "parameters": parameters}


def _sentences(model: type[BaseModel], errors: list[Any], table: Any) -> str:
    """One clause per key; where several forms are allowed, each complains of the same key."""
    by_key: dict[tuple, list[Any]] = {}
    for error in errors:
        by_key.setdefault(_key(error["loc"], table, error["type"] == "missing"), []).append(error)
    clauses = []
    for key, found in by_key.items():
        if len(found) == 1:
            clauses.append(_sentence(model, found[0]))
        else:
            value = table
            for step in key:
                value = value[step]
            clauses.append(
                f"{'.'.join(map(str, key))} = {_shorten(value)}; a number, [lo, hi] or names are"
                " needed"
            )
    return "; ".join(clauses[:_MOST_CLAUSES]) + (
        "; and more" if len(clauses) > _MOST_CLAUSES else ""
    )


def _key(loc: tuple, table: Any, missing: bool) -> tuple:
    """The part of an error's place that stands in the table; what follows names the form that did
    not fit.
    """
    key = []
    for step in loc:
        try:
            table = table[step]
        except (KeyError, IndexError, TypeError):
            # a key that is missing is a place of its own
            return (*key, step) if missing and isinstance(table, dict) else tuple(key)
        key.append(step)
    return tuple(key)


def _sentence(model: type[BaseModel], error: Any) -> str:
    path = [p for p in error["loc"] if isinstance(p, (str, int))]
    if path[1:] and path[-1] == "name":  # the file's own word for it
        path[-1] = _NAME_KEY.get(str(path[0]), "name")
    place = ".".join(str(p) for p in path)
    kind = error["type"]
    value = error.get("input")
    if kind == "extra_forbidden":
        return f"unknown key {place!r}: {suggestion(str(path[-1]), _fields(model, path[:-1]))}"
    if kind == "missing":
        return f"{'key' if len(path) > 1 else 'section'} {place!r} is missing, which is needed"
    message = str(error["msg"]).removeprefix("Value error, ")
    if kind == "value_error" and message == "a number is needed":
        return f"{place} = {_shorten(value)}; {message}"
    if kind == "value_error":
        return f"[{place}] {message}" if place else message
    if kind == "literal_error":
        allowed = [
            w.strip(" '") for w in str(error["ctx"]["expected"]).replace(" or ", ",").split(",")
        ]
        return f"{place} = {_shorten(value)} is unknown; {suggestion(str(value), allowed)}"
    return f"{place} = {_shorten(value)}; {message[0].lower()}{message[1:]}"


def _shorten(value: Any) -> str:
    try:
        text = value.isoformat() if isinstance(value, (date, time)) else repr(value)
    except (ValueError, RecursionError):  # more digits than Python writes, tables within tables
        return "a value too long to show"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _fields(model: type[BaseModel], path: list[Any]) -> list[str]:
    for step in path:
        field = model.model_fields.get(str(step))
        if (
            field is not None
            and isinstance(field.annotation, type)
            and issubclass(field.annotation, BaseModel)
        ):
            model = field.annotation
    return list(model.model_fields)
