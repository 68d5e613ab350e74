"""How probable stiction is, from two things a record shows: three numbers learned on simulated loops of grid `plant`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from detectors.verdict import STICTION, Verdict

FILE = Path(__file__).with_name("calibration.json")
ASKED = "procedure"  # the method whose verdict is weighed
GAIN = (-1.0, 3.0)  # tens of nats between which the likelihood's evidence counts; beyond, a model's errors are larger
EDGE = 0.99  # no probability is surer than the loops it was learned on can show


@dataclass(frozen=True)
class EvidenceWeights:
    """Log-odds of stiction = offset + gain (log-likelihood gain of friction / 10 nats) + verdict (where `ASKED` says stiction).

    Parameters
    ----------
    offset, gain, verdict : float
    loops : int
        How many simulated loops it was learned on.
    log_loss : float
        On loops whose kind of valve was left out.
    """

    offset: float
    gain: float
    verdict: float
    loops: int = 0
    log_loss: float = math.nan

    def probability(self, gain: float | None, called: bool) -> float:
        """Return the probability of stiction, even odds before looking.

        Parameters
        ----------
        gain : float or None
            Log-likelihood (nats) that friction brings over none; None where friction could not be fitted.
        called : bool
            Whether `ASKED` says stiction.
        """
        a, b = evidence(gain, called)
        logit = self.offset + self.gain * a + self.verdict * b
        return min(max(1.0 / (1.0 + math.exp(-logit)), 1.0 - EDGE), EDGE)

    def write(self, path: Path = FILE) -> None:
        """Write it where `read` finds it."""
        path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path = FILE) -> EvidenceWeights:
        """Return the numbers that came with the package."""
        return cls(**json.loads(path.read_text(encoding="utf-8")))


def evidence(gain: float | None, called: bool) -> tuple[float, float]:
    """Return the two numbers that are weighed: the likelihood's gain in tens of nats, bounded, and whether `ASKED` calls."""
    return min(max((gain or 0.0) / 10.0, GAIN[0]), GAIN[1]), float(called)


def calls(said: Sequence[Verdict]) -> bool:
    """Return whether `ASKED` is among the verdicts and says stiction."""
    return any(v.method == ASKED and v.verdict == STICTION for v in said)
