"""simbench: simulate control loops with sticking valves, benchmark stiction detectors, and diagnose
records from a plant.

The public names stand in `__init__.pyi`; each is loaded when first asked for.
"""

from simbench.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
