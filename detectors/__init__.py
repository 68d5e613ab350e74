"""Judge from the signals of a control loop whether its valve sticks.

Its methods need records and no simulator, but for `likelihood`, which fits whole loops.
"""

from simbench.detectors.errors import ParameterError, RecordError, UnknownName, UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import Verdict

__all__ = ["LoopRecord", "ParameterError", "RecordError", "UnknownName", "UserError", "Verdict"]
