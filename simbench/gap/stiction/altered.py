"""Alter an identified loop: with friction, without some effects, at a constant set point."""

from __future__ import annotations

from simbench.scenarios.parts import Part, SetPoint
from simbench.scenarios.spec import Loop

FRICTION = "stiction"


def with_friction(loop: Loop, S: float, J: float) -> Loop:
    """Return a loop whose stiction is replaced by S and J (%); S = 0 removes it."""
    sound = without(loop, (FRICTION,))
    if S <= 0:
        return sound
    stuck = Part(name=FRICTION, parameters={"S": float(S), "J": float(J)})
    return sound.model_copy(update={"effect": sound.effect + (stuck,)})


def without(loop: Loop, names: tuple[str, ...]) -> Loop:
    """Return a loop without some effects."""
    kept = tuple(part for part in loop.effect if part.name not in names)
    return loop.model_copy(update={"effect": kept})


def steady(loop: Loop) -> Loop:
    """Return a loop at a constant set point."""
    return loop.model_copy(update={"setpoint": SetPoint(value=loop.setpoint.value)})
