"""From what twins and likelihood say to a probability that holds: three numbers learned on simulated loops of grid `plant`."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

FILE = Path(__file__).with_name("calibration.json")
GAIN = (-1.0, 3.0)  # tens of nats between which the likelihood's evidence counts; beyond, a model's errors are larger
EDGE = 0.99  # no probability is surer than the loops it was learned on can show


@dataclass(frozen=True)
class EvidenceWeights:
    """Log-odds of stiction = offset + twins log-odds(p on twins) + gain (log-likelihood gain of friction / 10 nats).

    Parameters
    ----------
    offset, twins, gain : float
    loops : int
        How many simulated loops it was learned on.
    log_loss : float
        On loops left out.
    """

    offset: float
    twins: float
    gain: float
    loops: int = 0
    log_loss: float = math.nan

    def probability(self, of_twins: float, gain: float | None) -> float:
        """Return the probability of stiction.

        Parameters
        ----------
        of_twins : float
            What the verdicts and scores say, by the model learned on the record's twins.
        gain : float or None
            Log-likelihood (nats) that friction brings over none; None where friction could not be fitted.
        """
        logit = self.offset + sum(w * x for w, x in zip((self.twins, self.gain), evidence(of_twins, gain)))
        return min(max(1.0 / (1.0 + math.exp(-logit)), 1.0 - EDGE), EDGE)

    def write(self, path: Path = FILE) -> None:
        """Write it where `read` finds it."""
        path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path = FILE) -> EvidenceWeights:
        """Return the numbers that came with the package."""
        return cls(**json.loads(path.read_text(encoding="utf-8")))


def evidence(of_twins: float, gain: float | None) -> tuple[float, float]:
    """Return the two numbers that are weighed: log-odds on the twins, and the likelihood's gain in tens of nats, bounded."""
    return math.log(of_twins / (1.0 - of_twins)), min(max((gain or 0.0) / 10.0, GAIN[0]), GAIN[1])
