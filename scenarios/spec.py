"""The schema of one loop and of one labelled scenario: pure numbers and names, checked when
read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from simbench.scenarios.columns import with_columns
from simbench.scenarios.errors import SpecError, suggestion
from simbench.scenarios.parts import (
    MAX_SAMPLES,
    Archiving,
    Noise,
    OperatingPoint,
    Outer,
    Part,
    Sampling,
    SetPoint,
)
from simbench.scenarios.plant import SAME_DT, Controller, Plant
from simbench.scenarios.toml import content_hash, read_loop, toml_of
from simbench.scenarios.toml_table import NAME_KEY, TomlTable, checked


class Loop(TomlTable):
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
    def _check_inner(self) -> Self:
        # A loop alone may have steps
        if self.outer is None:
            return self
        if self.setpoint.steps:
            raise ValueError(
                "setpoint.steps: the set point of an inner loop is the outer OP; steps belong to"
                " [outer.setpoint]"
            )

        # The outer OP can ask for where PV rests
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
            if dt is not None and abs(dt / self.sampling.Ts - 1.0) > SAME_DT:
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

    def _stated_fields(self) -> dict[str, Any]:
        """Return the sections as the objects that they are, which need no second check."""
        return {name: section for name, section in self if section is not None}

    @property
    def pv0(self) -> float:
        """PV at rest, in its units."""
        pv0 = self.operating_point.pv0
        if pv0 is None:
            return self.setpoint.value
        return pv0

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
        # Parts that have names: one valve, lists of the others
        table = with_columns(table, Path(), where)
        for section, key in NAME_KEY.items():
            if section in table:
                many = section != "valve"
                if many:
                    parts = table[section]
                else:
                    parts = [table[section]]
                if not isinstance(parts, (list, tuple)):
                    raise SpecError(f"{where}: [{section}] must be written [[{section}]]")
                named = [_read_part(p, section, key, where) for p in parts]
                if many:
                    table[section] = named
                else:
                    table[section] = named[0]
        return checked(cls, table, where)

    def to_table(self) -> dict[str, Any]:
        """Return the loop as the nested table that `from_table` reads.

        Returns
        -------
        dict
            Section to its keys and values; lists of tables for disturbance and effect.
        """
        table = self.model_dump(exclude_none=True)
        for section, key in NAME_KEY.items():
            parts = [{key: p.name, **p.parameters} for p in _read_parts(getattr(self, section))]
            if section == "valve":
                table[section] = parts[0]
            else:
                table[section] = parts
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
        # Sections as a whole first, so that dotted keys change what they hold
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

            # A dotted key changes one number of a section
            if not name:
                table[section] = value
                continue
            if isinstance(table.get(section), list):
                raise SpecError(
                    f"key {key!r}: [[{section}]] is a list and cannot be set by name; {section} ="
                    " [...] sets it whole"
                )
            table[section] = {**table.get(section, {}), name: value}

        # The changed table is checked like a file
        return type(self).from_table(
            table, f"with {', '.join(f'{key} = {value}' for key, value in changes.items())}"
        )


def _no_key(key: str, value: Any) -> str:
    """Return why a key names nothing of a loop, and what is meant."""
    # No such section
    section, dot, _ = key.partition(".")
    if section not in Loop.model_fields:
        near = suggestion(section, Loop.model_fields)
        form = "" if dot else "; section.name is needed, such as valve.S"
        return f"unknown key {key!r}: no section {section!r}, {near}{form}"

    # A section without a key, or a key without a section
    if dot:
        return f"key {key!r} names section {section} and no key of it; section.name is needed"
    fields = getattr(Loop.model_fields[section].annotation, "model_fields", {})
    names = [f"{section}.{name}" for name in fields if section != "valve"] or [f"{section}.S"]
    return (
        f"key {key!r} = {value!r} is a section: a table is needed, or a key of it, such as"
        f" {names[0]}"
    )


class Scenario(TomlTable):
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


def _read_parts(value: Part | tuple[Part, ...]) -> tuple[Part, ...]:
    if isinstance(value, Part):
        return (value,)
    return value


def _read_part(table: Any, section: str, key: str, where: str) -> dict[str, Any]:
    # A part as it is
    if isinstance(table, Part):
        return table.model_dump()

    # A table needs the key that names its part
    if not isinstance(table, dict) or key not in table:
        if isinstance(table, dict):
            have = sorted(table)
        else:
            have = []
        if have:
            wrong = f" (found {', '.join(have)})"
        else:
            wrong = ""
        raise SpecError(f"{where}: [{section}] lacks the key {key!r}, which is needed{wrong}")

    # Everything else is a parameter
    parameters = {}
    for k, v in table.items():
        if k != key:
            parameters[k] = v
    return {"name": table[key], "parameters": parameters}
