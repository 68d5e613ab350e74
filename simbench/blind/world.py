"""A world: an independent simulator that draws records with hidden effects and can run their loops again."""

from __future__ import annotations

from detectors.plugins.registry import PluginFolder

WORLDS = PluginFolder(
    "world", "simbench.blind.worlds", "simbench.worlds", ("TITLE", "FOREIGN", "Item", "draw", "simulate")
)  # fmt: skip
OWN = "own"
