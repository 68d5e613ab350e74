"""How an effect is recognised: one effect per file, beside the one that says what it does."""

from __future__ import annotations

from functools import cache

from detectors.registry import PluginFolder
from simbench.gap.effects._recogniser import NOT_TRIED, Parameters, Recogniser

__all__ = ["NOT_TRIED", "PLUGINS", "Parameters", "Recogniser", "recogniser"]

PLUGINS = PluginFolder("recognised effect", "simbench.gap.effects", "simbench.recognised", ("RECOGNISER",))


@cache
def recogniser(effect: str) -> Recogniser:
    """Return how an effect is recognised; one that is only simulated, because nobody said how, is never recognised.

    Parameters
    ----------
    effect : str
        Effect id.

    Returns
    -------
    Recogniser

    Examples
    --------
    >>> recogniser("stiction").fit is None, recogniser("saturation").fit is None
    (False, True)
    """
    return PLUGINS.load(effect).RECOGNISER if effect in PLUGINS.names() else Recogniser()
