"""Recognise a frozen sensor: PV repeats its value exactly, longer than chance explains, while OP
moves.
"""

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.exact import shown

RECOGNISER = Recogniser(proven=lambda s: shown(s, "held"))
