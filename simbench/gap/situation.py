"""A checked record with its baseline: the input of everything that fits, simulates or decides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.gap.controller.law import Law
from simbench.gap.likelihood.model import REDDEST, Data
from simbench.gap.sensor.samples import Samples
from simbench.loop.resolve import undisturbed
from simbench.loop.response import stages_response
from simbench.scenarios.parts import Part, Sampling
from simbench.scenarios.spec import Loop

# longest correlation time of an ordinary load, in time scales of the loop; a slower one drifts
_LOAD_MEMORY = 4.0


@dataclass(frozen=True)
class Archive:
    """What single samples prove of the PV on record.

    `rounding` is a lattice's step and where PV was put on it: in the "loop", where the controller
    sees it, or in the "record" alone. `band` is the largest error of the lines that an archive drew
    between the samples it kept. `spikes` are the share of samples hit, their mean height, and
    where. What does not show is None or 0.
    """

    rounding: tuple[float, str] | None = None
    band: float = 0.0
    spikes: tuple[float, float, str] | None = None

    @property
    def faithful(self) -> bool:
        """Whether PV on record is PV, but for its digits."""
        return self.rounding is None and self.band == 0.0 and self.spikes is None


def coloured_on_pv(baseline: Loop, Ts: float, slow: bool) -> list[dict[str, Any]]:
    """Return the parameters of the coloured loads that the baseline states on PV: the `slow` ones,
    or those of so little memory that they are noise.
    """
    loads = [part.parameters for part in baseline.disturbance if part.name == "coloured"]
    on_pv = []
    for load in loads:
        if load.get("at") == "output":
            on_pv.append(load)
    coloured = []
    for load in on_pv:
        if (np.exp(-Ts / float(load["period"])) >= REDDEST) == slow:
            coloured.append(load)
    return coloured


@dataclass(frozen=True, eq=False, kw_only=True)
class Seen:
    """A record beside its baseline, with what its controller and its single samples do."""

    record: LoopRecord
    baseline: Loop
    trusted: bool  # the baseline's plant is its author's, not identified
    tuned: bool  # its controller is
    op: np.ndarray  # (n,), %
    sp: np.ndarray  # (n,), PV units; the mean of PV where none is recorded
    noise: float  # standard deviation of PV's noise as the baseline states it, PV units
    law: Law
    samples: Samples

    @property
    def pace(self) -> int:
        """How often the loop runs in a sample of the record."""
        return round(self.record.Ts / self.baseline.sampling.Ts)


@dataclass(frozen=True, eq=False, kw_only=True)
class Situation(Seen):
    """A record with its baseline, checked, with what single blocks show before anything is
    fitted.
    """

    archive: Archive
    data: Data  # the engine's input
    notes: list[str] = field(default_factory=list)  # what the reader must know
    frozen: bool = False  # PV rests while OP moves
    unexplained_law: str = ""  # why the controller is none of the known ones
    # numbers of the effects that the controller's law or single samples show without doubt
    proven: dict[str, dict[str, float | str]] = field(default_factory=dict)

    @property
    def where(self) -> str:
        """The record's name, as messages begin."""
        return name_of_record(self.record)

    @property
    def facts(self) -> set[str]:
        """The effects that single samples or the controller's law show without doubt."""
        archive = self.archive
        law = self.law
        seen = {
            "quantisation": archive.rounding is not None,
            "compression": archive.band > 0.0,
            "outliers": archive.spikes is not None,
            "saturation": law.limits is not None,
            "error_deadband": law.gap > 0.0,
            "op_quantisation": law.step > 0.0,
            "detuning": law.tuning is not None,
        }
        return {effect for effect, shows in seen.items() if shows}

    @property
    def stated_parts(self) -> bool:
        """Whether the baseline's author states its plant or its tuning: else all is identified."""
        return self.trusted or self.tuned

    @property
    def expected_band(self) -> float:
        """Dead-band (%) of the baseline's valve, 0 of one that jumps or has none."""
        parameters = self.baseline.valve.parameters
        if "S" in parameters and not parameters.get("J"):
            return float(parameters["S"])
        return 0.0

    @property
    def stated(self) -> frozenset[str]:
        """The effects that the baseline states: the simulation has them, whatever their size."""
        return frozenset(part.name for part in self.baseline.effect)

    @property
    def loads_on_pv(self) -> list[dict[str, Any]]:
        """The slow coloured loads that the baseline states on PV, as a loop file has them: the
        measurement wanders with them.
        """
        slow = coloured_on_pv(self.baseline, self.record.Ts, slow=True)
        return [{"type": "coloured", **load} for load in slow]

    @property
    def integrating(self) -> bool:
        """Whether the plant integrates."""
        return self.baseline.plant.integrating


def name_of_record(record: LoopRecord) -> str:
    """Return a record's name, as messages about it begin."""
    if record.tag:
        return f"record {record.tag!r}"
    return "record"


def through_valve(
    op: np.ndarray, baseline: Loop, Ts: float, effect: Mapping[str, Any] | None = None
) -> np.ndarray:
    """Return MV (%) as the baseline's valve makes it of OP, the effects that the baseline states
    included, and one more.
    """
    if baseline.valve.name == "ideal" and not baseline.effect and effect is None:
        return op
    if effect is None:
        effects = baseline.effect
    else:
        effects = baseline.effect + (Part.of("effect", effect),)
    sampling = Sampling(Ts=Ts, n=max(op.size, 3))
    try:
        valves = undisturbed(baseline.replace(effect=effects, sampling=sampling)).valves
    except UserError:
        # friction beside friction
        return op
    op = np.ascontiguousarray(op, dtype=float)
    return np.clip(stages_response(tuple(valves), op, float(op[0])), 0.0, 100.0)


def load_memory(situation: Situation) -> float:
    """Return the longest correlation time (samples) of a load that is still taken for ordinary."""
    d = situation.data
    control = situation.baseline.controller
    pace = d.T + d.Td
    if situation.integrating:
        # an integrating plant has no time constant; its loop has
        pace = d.Td + 1.0 / max(abs(d.K * control.Kc), 1e-9)
    return float(np.clip(_LOAD_MEMORY * pace, 5.0, 0.2 * d.n))
