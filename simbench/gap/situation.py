"""A record beside its baseline, checked: what every room that fits, simulates or decides is told."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.controller.pi_law import Law
from simbench.gap.likelihood.model import Data
from simbench.gap.sensor.samples import Samples

LOAD_MEMORY = 4.0  # longest correlation time of an ordinary load, in time scales of the loop; a slower one drifts


@dataclass(frozen=True, eq=False)
class Situation:
    """A record beside its baseline, checked, with what single blocks show before anything is fitted.

    `plant_pv` is the PV the plant gave the controller, as far as it can be recovered; `data` the engine's input; `hard` the
    effects that the controller's law or single samples show without doubt; `notes` what the reader must know; `frozen` and
    `unexplained_law` why the controller is none of the known ones. `trusted`: the baseline's plant is its author's, not
    identified; `tuned`: its controller is.
    """

    record: LoopRecord
    baseline: Loop
    trusted: bool
    tuned: bool
    op: np.ndarray
    sp: np.ndarray
    law: Law
    samples: Samples
    plant_pv: np.ndarray
    data: Data
    proven: dict[str, dict[str, float | str]]
    notes: list[str] = field(default_factory=list)
    frozen: bool = False
    unexplained_law: str = ""

    @property
    def integrating(self) -> bool:
        """Whether the plant integrates."""
        return self.baseline.plant.type == "integrating"


def load_memory(situation: Situation) -> float:
    """Return the longest correlation time (samples) of a load that is still taken for ordinary."""
    d, control = situation.data, situation.baseline.controller
    pace = d.T + d.Td
    if situation.integrating:
        # an integrating plant has no time constant of its own; its loop has
        pace = d.Td + 1.0 / max(abs(d.K * control.Kc), 1e-9)
    return float(np.clip(LOAD_MEMORY * pace, 5.0, 0.2 * d.n))
