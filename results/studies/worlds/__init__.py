"""Development worlds: independent plant simulators on which the gap diagnosis was developed.

Each was written without sight of `simbench`. Since then the diagnosis has been calibrated on them,
so they no longer count as unseen data. Importing this package makes them known by their short
names; `simbench gap withheld make --world results.studies.worlds.mill` takes one by its module.
"""

from results.studies.worlds import mill, refinery
from simbench.blind.world import WORLDS

__all__ = ["NAMES", "WORLDS"]

NAMES = ("own", "mill", "refinery")

WORLDS.adopt({"mill": mill, "refinery": refinery})
