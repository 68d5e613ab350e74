"""What can be concluded about a control loop from its signals; usable alone by an engineer who has
only plant data.
"""

from detectors.errors import ParameterError, RecordError, UnknownName, UserError
from detectors.record import LoopRecord
from detectors.verdict import Verdict

__all__ = ["LoopRecord", "ParameterError", "RecordError", "UnknownName", "UserError", "Verdict"]
