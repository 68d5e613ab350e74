"""The smaller tables of a loop file: sampling, noise, archive, set point, the outer loop of a
cascade, and the parts that are plug-ins.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from simbench.scenarios.plant import CONTROLLER_TYPES, PLANT_TYPES, Controller, Plant, Value
from simbench.scenarios.toml_table import (
    NAME_KEY,
    Finite,
    Flag,
    NonNegative,
    Positive,
    Real,
    TomlTable,
    Whole,
)

MAX_SAMPLES = 20_000_000  # a run holds about ten arrays of n doubles: 1.6 GB here


class OperatingPoint(TomlTable):
    """Where the run rests before it starts: OP in %, PV in its units (None: the set point's start
    value).
    """

    op0: Annotated[Real, Field(ge=0, le=100, allow_inf_nan=False)] = 50.0
    pv0: Finite | None = None


class Sampling(TomlTable):
    """Ts in s; n samples of the record; `warm_up` samples are simulated before it and dropped.

    The run starts in equilibrium, at the first sample of the warm-up: times of loads and set-point
    steps count from there.
    """

    Ts: Positive
    n: Annotated[Whole, Field(ge=3, le=MAX_SAMPLES)] = 4000
    warm_up: Annotated[Whole, Field(ge=0, le=MAX_SAMPLES)] | None = None


class Noise(TomlTable):
    """White measurement noise: std on PV (PV units), which the controller sees, mv_std on the
    recorded MV alone (%).
    """

    std: NonNegative = 0.0
    mv_std: NonNegative | None = None


class Archiving(TomlTable):
    """What is done to the samples on their way to the record, which the controller does not see:
    OP (%) and PV written in steps, and their last value repeated where `op_held` or `pv_held` is 1.

    `op_held` and `pv_held` are lists of 0 and 1, one a sample, begun again where the record is
    longer, or the columns of these names in `file`, a CSV file beside the loop file.
    """

    op_step: NonNegative = 0.0
    pv_step: NonNegative = 0.0
    op_held: tuple[Flag, ...] | None = None
    pv_held: tuple[Flag, ...] | None = None


class SetPoint(TomlTable):
    """Start value and later steps [[t in s, new value], ...], or the columns `sp_time` and `sp` of
    these in `file`, a CSV file beside the loop file.
    """

    value: Finite = 50.0
    steps: tuple[tuple[NonNegative, Finite], ...] = ()


class Outer(TomlTable):
    """The outer loop of a cascade: its OP, 0..100 % over `sp_span`, is the set point of the loop
    that has the valve.

    Its plant leads from that loop's PV to its own; both are sampled together.
    """

    plant: Plant
    controller: Controller
    setpoint: SetPoint = SetPoint()
    noise: Noise = Noise()
    sp_span: tuple[Finite, Finite] = (0.0, 100.0)

    @model_validator(mode="after")
    def _check_feedback(self) -> Self:
        # Only the package's plants and controllers, in s
        if self.plant.type not in PLANT_TYPES or self.controller.type not in CONTROLLER_TYPES:
            kinds = f"plants {', '.join(PLANT_TYPES)} and controllers {', '.join(CONTROLLER_TYPES)}"
            raise ValueError(f"an outer loop takes no plug-in; {kinds} are allowed")
        if self.plant.dt or self.controller.dt:
            raise ValueError("an outer loop takes no part in powers of z; one in s is needed")

        # Set points that rise, and negative feedback
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
        key = NAME_KEY[section]
        return cls(name=table[key], parameters={k: v for k, v in table.items() if k != key})
