"""The plant and the controller of a loop."""

from __future__ import annotations

import math
from typing import Any, Literal, Self

import numpy as np
from pydantic import model_serializer, model_validator

from simbench.scenarios.polynomials import checked_polynomials, checked_sampled, integrates
from simbench.scenarios.toml_table import Finite, NonNegative, Positive, TomlTable

Value = float | int | str | bool | list[Any] | dict[str, Any]


class Plant(TomlTable):
    """G(s) between valve and PV: K e^(-Td s)/(T s + 1), K e^(-Td s)/s, num(s)/den(s) e^(-Td s), or
    a plug-in's.

    K in PV units per % (integrating: per % and s), T and Td in s; `num` and `den` in falling powers
    of s, or with `dt`, the sampling period, of z: what the samples of PV do under held samples of
    MV. Of a "tf" plant K follows, and T where it is of first order; `parameters` are those of a
    plug-in, whose K and T count where it has them.
    """

    type: str
    K: Finite
    T: Positive | None = None
    Td: NonNegative = 0.0
    num: tuple[Finite, ...] | None = None
    den: tuple[Finite, ...] | None = None
    dt: Positive | None = None
    parameters: dict[str, Value] | None = None

    @model_validator(mode="before")
    @classmethod
    def _read_table(cls, table: Any) -> Any:
        if not isinstance(table, dict) or not isinstance(table.get("type"), str):
            return table
        if table["type"] == "tf":
            if table.get("dt") is None:
                return _read_tf(table)
            return _read_sampled(table)
        if table["type"] not in PLANT_TYPES:
            _refuse_misspelt(table["type"], PLANT_TYPES)
            return _read_plugin(table, ("type", "Td"), {"K": 1.0})
        return table

    @model_validator(mode="after")
    def _check_whole(self) -> Self:
        # Keys that this type of plant has
        if self.K == 0:
            raise ValueError("K = 0; the valve must act on PV")
        for name in ("num", "den", "dt"):
            if self.type in ("foptd", "integrating") and getattr(self, name) is not None:
                raise ValueError(
                    f"{name} belongs to a plant of type 'tf'; {self.type} needs"
                    f" K{', T' * (self.type == 'foptd')}"
                )

        # A dead time of whole samples in powers of z
        if self.dt is not None and abs(self.Td / self.dt - round(self.Td / self.dt)) > SAME_DT:
            raise ValueError(
                f"Td = {self.Td:g} s is no whole number of samples of dt = {self.dt:g} s, which a"
                " plant in powers of z needs"
            )

        # The time constant that this type needs, or must not have
        if self.type == "foptd" and self.T is None:
            raise ValueError("T is missing; foptd needs a time constant above 0 s")
        if self.type == "integrating" and self.T is not None:
            raise ValueError(
                f"T = {self.T}; an integrating plant has no time constant, no T is needed"
            )
        return self

    @model_serializer(mode="wrap")
    def _write(self, handler: Any) -> dict[str, Any]:
        return _flat_table(
            handler(self),
            {"tf": ("K", "T")}.get(self.type, ()) if self.parameters is None else ("K", "T"),
        )

    @property
    def integrating(self) -> bool:
        """Whether the plant integrates; a plug-in's own file says so, not its loop."""
        if self.den is None:
            return self.type == "integrating"
        if self.dt is None:
            return self.den[-1] == 0.0
        return integrates(self.den)

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


class Controller(TomlTable):
    """PI, P, PID or "tf": Kc in % per PV unit, times in s; "reverse" raises OP when PV falls. Other
    types are plug-ins.

    "tf": OP answers to the error by `num` over `den` in falling powers of z, with `dt` the sampling
    period; the law goes on from the limited OP, which is its anti-windup.

    PID: Td of the derivative, filtered with Td/N; weights b and c of SP in its P and D part;
    `form`; `anti_windup` with its tracking time Tt; `schedule` = [[value, factor on Kc], ...] over
    `schedule_on`, straight between.
    """

    type: str
    Kc: Positive
    Ti: Positive | None = None
    direction: Literal["reverse", "direct"] = "reverse"
    Td: NonNegative | None = None
    N: Positive | None = None
    form: Literal["positional", "velocity"] | None = None
    b: NonNegative | None = None
    c: NonNegative | None = None
    anti_windup: Literal["clamping", "back-calculation"] | None = None
    Tt: Positive | None = None
    schedule: tuple[tuple[Finite, Positive], ...] | None = None
    schedule_on: Literal["pv", "op", "sp"] | None = None
    num: tuple[Finite, ...] | None = None
    den: tuple[Finite, ...] | None = None
    dt: Positive | None = None
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
        # Keys that this type of controller has
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

        # A schedule has rising values, and something it depends on
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
        return _flat_table(handler(self), ("Kc", "Ti") if own else ())

    @property
    def sign(self) -> float:
        """+1 for "reverse", -1 for "direct"."""
        return 1.0 if self.direction == "reverse" else -1.0


PLANT_TYPES = ("foptd", "integrating", "tf")
CONTROLLER_TYPES = ("PI", "P", "PID", "tf")
SAME_DT = 1e-6  # of a sample, by which a dead time in whole samples, or dt and Ts, may differ
_OF_PID = ("Td", "N", "form", "b", "c", "anti_windup", "Tt", "schedule", "schedule_on")


def _refuse_misspelt(word: str, known: tuple[str, ...]) -> None:
    """Refuse the letters of a built-in type in another order or case: no plug-in's name, but a
    slip.
    """
    near = []
    for k in known:
        if sorted(k.lower()) == sorted(word.lower()):
            near.append(k)
    if near:
        raise ValueError(f"type = {word!r} is unknown; did you mean {near[0]!r}?")


def _read_tf(table: dict[str, Any]) -> dict[str, Any]:
    """Return a table of num and den with the K, and of a first-order plant the T, that follow from
    them.
    """
    # The file states polynomials, not K or T
    given = []
    for name in ("K", "T"):
        if table.get(name) is not None:
            given.append(name)
    if given:
        raise ValueError(
            f"{given[0]} = {table[given[0]]}; a plant of type 'tf' has num, den and Td"
        )
    _refuse_missing(table, "plant", "s")

    # K is the steady gain, or the rate of an integrator; T is that of a first-order plant
    num, den = checked_polynomials(table["num"], table["den"])
    order = den.size - 1
    integrating = den[-1] == 0.0
    K = float(num[-1] / den[-2 if integrating else -1])
    if order == 1 and not integrating:
        T = {"T": float(den[0] / den[1])}
    else:
        T = {}
    return {**table, "num": num.tolist(), "den": den.tolist(), "K": K, **T}


def _read_sampled(table: dict[str, Any]) -> dict[str, Any]:
    """Return a table of num and den in powers of z with the K, and of a first-order plant the T,
    that follow from them.
    """
    _refuse_missing(table, "plant", "z")
    num, den = checked_sampled(table["num"], table["den"], 1)

    # without its pole at z = 1, an integrating plant's gain is that of the slope
    if integrates(den.tolist()):
        rest = np.cumsum(den)[:-1] * float(table["dt"])
    else:
        rest = den
    K = float(num.sum() / rest.sum())
    if den.size == 2 and 0 < -den[1] < 1:
        T = {"T": float(-table["dt"] / math.log(-den[1]))}
    else:
        T = {}
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
    # The plug-in's own parameters
    own = {}
    for k, v in table.items():
        if k not in (common + ("parameters",)):
            own[k] = v
    own.update(table.get("parameters") or {})

    # Those that a plain part has as well
    if "K" in default:
        wanted = ("K", "T")
    else:
        wanted = ("Kc", "Ti")
    known = {}
    for k in wanted:
        if isinstance(own.get(k), (int, float)) and not isinstance(own[k], bool) and own[k]:
            known[k] = own[k]
    return {**{k: table[k] for k in common if k in table}, **default, **known, "parameters": own}


def _flat_table(table: dict[str, Any], follow: tuple[str, ...]) -> dict[str, Any]:
    """Return a part's table as a file writes it: without what follows, a plug-in's parameters among
    the rest.
    """
    own = table.pop("parameters", None) or {}
    return {**{k: v for k, v in table.items() if k not in follow and v is not None}, **own}
