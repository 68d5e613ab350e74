"""Judge from the signals of a control loop whether its valve sticks.

This package works alone, for an engineer who has plant data and needs no simulator.
"""

from simbench.detectors.errors import ParameterError, RecordError, UnknownName, UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import Verdict

__all__ = ["LoopRecord", "ParameterError", "RecordError", "UnknownName", "UserError", "Verdict"]
