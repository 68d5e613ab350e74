"""Why does a simulated loop not look like the plant's record: where, which effect, how far it
shrinks.

The public names stand in `__init__.pyi`; each is loaded when first asked for: the blind check's
generator lives in this package and must not load the models the diagnosis uses.
"""

from simbench.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
