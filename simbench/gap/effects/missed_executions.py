"""Recognise missed executions of the controller: OP stays constant where its law, exact elsewhere,
would move it.
"""

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.exact import shown

RECOGNISER = Recogniser(proven=lambda s: shown(s, "idle"))
