"""The folder of the figures, each one found by its file's name."""

from simbench.detectors.plugins.registry import PluginFolder

FIGURES = PluginFolder("figure", "simbench.figures", "simbench.figures", ("SOURCE", "data", "draw"))
