"""A refinery's loops in continuous time: plant, valve and load on a fine grid, a DCS scan, a
transmitter, a historian.
"""

from results.studies.worlds.refinery.drawing import Item, draw, simulate, test
from results.studies.worlds.refinery.foreign import FOREIGN

TITLE = (
    "refinery: continuous-time loops under a scanning DCS, with faults of distillation, heat"
    " exchange and compressors"
)

__all__ = ["FOREIGN", "TITLE", "Item", "draw", "simulate", "test"]
