"""Recognise derivative action: the controller law explains OP with a term in the rate of PV."""

from simbench.gap.effects._recogniser import Recogniser
from simbench.gap.exact import shown

RECOGNISER = Recogniser(proven=lambda s: shown(s, "derivative"))
