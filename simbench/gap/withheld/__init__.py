"""The blind check: records with hidden effects from an independent generator, sealed answers, and their scoring."""

from simbench.gap.withheld.answer import answer
from simbench.gap.withheld.make import Plan, make
from simbench.gap.withheld.opening import open_

__all__ = ["Plan", "answer", "make", "open_"]
