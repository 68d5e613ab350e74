"""Missed executions recognised: OP rests where its law, exact everywhere else, would move it."""

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.exact import shown

RECOGNISER = Recogniser(proven=lambda s: shown(s, "idle"))
