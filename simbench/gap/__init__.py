"""Gap diagnosis: explain why a simulated loop differs from the plant's record, name the missing
effect, and measure how far it shrinks the gap.

The public names stand in `__init__.pyi`; each is loaded when first asked for: the blind check's
generator lives in this package and must not load the models the diagnosis uses.
"""

from simbench.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
