"""Development worlds: the product's own, and a refinery written without sight of `simbench`.

Since then the diagnosis has been calibrated on both, so they no longer count as unseen data.
Importing this package makes the second known by its short name; `simbench gap withheld make --world
results.studies.worlds.refinery` takes it by its module.
"""

from results.studies.worlds import refinery
from simbench.sealed.withheld.world import WORLDS

__all__ = ["NAMES", "WORLDS"]

NAMES = ("own", "refinery")

WORLDS.adopt({"refinery": refinery})
