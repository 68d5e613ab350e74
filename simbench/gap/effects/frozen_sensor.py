"""Frozen sensor recognised: PV repeats itself exactly beyond chance while OP moves."""

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.exact import shown

RECOGNISER = Recogniser(proven=lambda s: shown(s, "held"))
