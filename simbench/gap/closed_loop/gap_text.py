"""The gap in words."""

from __future__ import annotations


def apart(gap: float, plant_floor: float) -> str:
    """Return how far simulations are from a record, and how far its parts are from each other."""
    return f"{gap:.2f} from the record, whose parts are {plant_floor:.2f} apart"
