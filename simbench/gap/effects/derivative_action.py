"""Derivative action recognised: the law of OP holds once PV's speed is a term of it."""

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.exact import shown

RECOGNISER = Recogniser(proven=lambda s: shown(s, "derivative"))
