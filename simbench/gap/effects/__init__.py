"""Recognise effects in a record: one file per effect with its fit; the file that simulates the
effect has the same name.
"""

from __future__ import annotations

from functools import cache

from simbench.detectors.plugins.registry import PluginFolder
from simbench.gap.effects._recogniser import NOT_IN_PLANT, Parameters, Recogniser
from simbench.loop.effects import EFFECTS

__all__ = [
    "NOT_IN_PLANT",
    "PLUGINS",
    "Parameters",
    "Recogniser",
    "is_friction",
    "recogniser",
]

PLUGINS = PluginFolder(
    "recognised effect", "simbench.gap.effects", "simbench.recognised", ("RECOGNISER",)
)


@cache
def recogniser(effect: str) -> Recogniser:
    """Return how an effect is recognised; one that is only simulated, as no file recognises it,
    is never recognised.

    Parameters
    ----------
    effect : str
        Id of the effect.

    Returns
    -------
    Recogniser
        What its file states, or one that recognises nothing.
    """
    if effect in PLUGINS.names():
        return PLUGINS.load(effect).RECOGNISER
    return Recogniser()


def is_friction(answer: str) -> bool:
    """Return whether an answer is an effect with friction: a valve that rests within a band.

    Parameters
    ----------
    answer : str
        Id of an effect, "none" or "unknown".

    Returns
    -------
    bool
        False of none, of unknown, and of every effect without a band.
    """
    return answer in EFFECTS and recogniser(answer).band is not None
