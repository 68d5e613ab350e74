"""What a grid file may say: blocks of cells, their axes, and the members of a cell."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_serializer, model_validator

from simbench.scenarios.cell import SETTINGS, Scaled
from simbench.scenarios.errors import suggestion
from simbench.scenarios.plant import Value
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml_table import Real, TomlTable, Whole

Range = Real | tuple[Real, Real]
Names = str | tuple[str, ...]
_Scale = Literal["S", "J", "period", "pv"]
GRID_KEYS = ("seed", "repeats")
# they change no scenario
UNHASHED = ("title", "source", "author", "date", "version", "expected", "told_from_recorded")
_MOST_REPEATS = 1_000_000


class Disturbance(TomlTable):
    """A load by its size against the sticky twin: amplitude in its PV std (at "input": its S),
    times in its periods.
    """

    type: str
    at: str = "output"
    amplitude: Range
    period: Range
    parameters: dict[str, Range] = Field(default_factory=dict)


class More(TomlTable):
    """Parameters of a valve or an effect beyond the cell's (S, J): drawn, then multiplied by what
    `scale` names.

    S, J: of the cell (% of travel); period, pv: of the sticky twin's cycle (s), PV std of it (PV
    units).
    """

    name: str | None = None
    parameters: dict[str, Range | Names] = Field(default_factory=dict)
    scale: dict[str, _Scale] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_scale(self) -> Self:
        for key in self.scale:
            if key not in self.parameters:
                raise ValueError(
                    f"scale asks for {key!r}, which is none of the parameters,"
                    f" {suggestion(key, self.parameters)}"
                )
        return self

    def drawn(self, name: str, rng: np.random.Generator) -> Scaled:
        """Return the part with its parameters drawn; `name` is that of the table."""
        values = {}
        for key, value in sorted(self.parameters.items()):
            values[key] = draw(value, rng)
        return Scaled(self.name or name, values, dict(self.scale))


def _without_defaults(*keys: str) -> Any:
    """Return how a table is written: keys that are younger than the first grids only where they are
    used, as the others keep their hash.
    """

    def written(self: Any, handler: Any) -> dict[str, Any]:
        default = {key: type(self).model_fields[key].default for key in keys}
        return {k: v for k, v in handler(self).items() if k not in default or v != default[k]}

    return written


class Member(TomlTable):
    """One of the scenarios that share a cell: a valve, and what else sets it apart from its
    siblings.

    `echo` makes a healthy loop move as a sticky one of its cell does, so that neither amplitude nor
    period nor rhythm tells them apart: plant, controller, loads, noise and numbers are those of the
    sibling `of` (by default the first sticky member), the seed is another, and a load of type
    `echo` is added. A loop whose sibling does not cycle with this seed is left out and counted.
    """

    name: str
    valve: Names
    tuning: Names | None = None
    disturbance: Names | None = None
    echo: Names | None = None
    of: str | None = None
    where: dict[str, tuple[Value, ...]] = Field(default_factory=dict)

    _written = model_serializer(mode="wrap")(_without_defaults("echo", "of"))


class Block(TomlTable):
    """A product of axes; `draw` ranges are drawn evenly in logarithm, once per group.

    Where `ranked` is false no ranking counts its loops: false positives by cause show them.
    """

    name: str
    says: str = ""
    process: str = "foptd"
    controller: str = "PI"
    axes: dict[str, tuple[Value, ...]] = Field(default_factory=dict)
    draw: dict[str, Range | Names] = Field(default_factory=dict)
    member: tuple[Member, ...] = ()
    ranked: bool = True

    _written = model_serializer(mode="wrap")(_without_defaults("ranked"))


class GridFile(TomlTable):
    """What a grid file holds: blocks of ruled cells, or one whole loop with axes of dotted keys."""

    title: str = "own grid"
    source: str = "own"
    author: str = ""
    date: str = ""
    version: Annotated[Whole, Field(ge=1)] = 1
    expected: int | None = None
    # AUC with which a classifier tells its loops from recorded ones (results/grid_gaps.txt)
    told_from_recorded: Annotated[Real, Field(ge=0.0, le=1.0)] | None = None
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 0
    repeats: Annotated[Whole, Field(ge=1, le=_MOST_REPEATS)] = 1
    draw: dict[str, Range | Names] = Field(default_factory=dict)
    disturbances: dict[str, Disturbance] = Field(default_factory=dict)
    valves: dict[str, More] = Field(default_factory=dict)
    effects: dict[str, More] = Field(default_factory=dict)
    block: tuple[Block, ...] = ()
    loop: dict[str, Any] | None = None
    axes: dict[str, tuple[Value, ...]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        # Blocks or one loop, not both
        if bool(self.block) == (self.loop is not None):
            raise ValueError("a grid has either [[block]] tables or one [loop] with [axes]")

        # Every axis and draw is a setting, or a key of the loop
        for block in self.block:
            for key in tuple(self.draw) + tuple(block.axes) + tuple(block.draw):
                if key not in SETTINGS and not is_of_loop(key):
                    raise ValueError(
                        f"block {block.name!r}: unknown axis {key!r}, {suggestion(key, SETTINGS)}"
                    )

            # What a member is kept to is an axis of its block
            for member in block.member:
                for key in member.where:
                    if key not in block.axes:
                        none = f"where asks for {key!r}, which is none of its axes"
                        raise ValueError(
                            f"block {block.name!r}: {none}, {suggestion(key, block.axes)}"
                        )
        return self


def draw(allowed: Range | Names, rng: np.random.Generator) -> float | str:
    """Return a fixed value as it is, one of several names, or a value drawn evenly in logarithm
    from (lo, hi).
    """
    if not isinstance(allowed, tuple):
        return allowed
    if isinstance(allowed[0], str):
        return pick(allowed, rng)
    lo, hi = allowed
    return math.exp(rng.uniform(math.log(lo), math.log(hi)))


def pick(names: Names, rng: np.random.Generator) -> str:
    """Return one of several names, each as likely."""
    if isinstance(names, str):
        return names
    return names[int(rng.integers(len(names)))]


def is_of_loop(key: str) -> bool:
    """Return whether an axis is a key of the loop file, or one of its sections whole, and none of a
    cell's settings.
    """
    return key not in SETTINGS and ("." in key or key in Loop.model_fields)
