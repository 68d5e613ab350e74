"""The parts that a loop names, looked up: plug-ins, the linear plant, and its stages."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, UnknownName
from simbench.detectors.plugins.registry import PluginFolder
from simbench.loop import plant
from simbench.loop.parameters import (
    CONTROLLER_PLUGINS,
    PLANT_PLUGINS,
    VALVES,
    resolve,
    valve_parameters,
)
from simbench.loop.sampled import law as sampled_law
from simbench.loop.sampled import plant as sampled_plant
from simbench.scenarios.parts import Part
from simbench.scenarios.plant import CONTROLLER_TYPES, PLANT_TYPES
from simbench.scenarios.polynomials import checked_polynomials
from simbench.scenarios.spec import Loop


@dataclass(frozen=True, eq=False)
class LoopParts:
    """What no seed changes of a loop: the plant's transfer function, the stages of the valve and
    the plug-ins, looked up and checked.
    """

    num: np.ndarray
    den: np.ndarray
    valves: tuple[tuple[ModuleType, Any], ...]
    plant_plugin: tuple[ModuleType, Any] | None
    control_plugin: tuple[ModuleType, Any] | None


def look_up_parts(loop: Loop, tf: Any = None) -> LoopParts:
    """Return the parts of a loop; `tf` takes the place of its plant (its dead time stays)."""
    own = _plant_plugin(loop) if tf is None else None
    if tf is not None:
        num, den = plant.polynomials_of(tf)
    elif own is None:
        num, den = plant.polynomials(loop.plant)
    else:
        num, den = linear_plant(*own)
    # the sign of a law in powers of z is that of its num
    signs = loop.controller.type != "tf" and (own is None or hasattr(own[0], "linear"))
    if signs and loop.controller.sign * num[-1] / den[den != 0][-1] < 0:
        raise ParameterError(
            "positive feedback: the plant's gain and the controller's direction have opposite signs"
        )
    return LoopParts(
        num=num,
        den=den,
        valves=tuple(stages_of(loop.valve, loop.sampling.Ts)),
        plant_plugin=own,
        control_plugin=_control_plugin(loop),
    )


def _plant_plugin(loop: Loop) -> tuple[ModuleType, Any] | None:
    """Return a plug-in plant, or one in powers of z, and its numbers: its PARAMETERS, then Td, Ts
    (s), op0 (%) and pv0.
    """
    if loop.plant.dt is not None:
        return sampled_plant, sampled_plant.numbers(loop.plant)
    return _plugin(PLANT_PLUGINS, loop.plant, PLANT_TYPES, loop, Td=loop.plant.Td)


def _control_plugin(loop: Loop) -> tuple[ModuleType, Any] | None:
    """Return a plug-in controller, or one in powers of z, and its numbers: its PARAMETERS, then
    sign, OP's limits, Ts (s), op0 (%) and pv0.
    """
    if loop.controller.dt is not None:
        return sampled_law, sampled_law.numbers(loop.controller)
    return _plugin(
        CONTROLLER_PLUGINS,
        loop.controller,
        CONTROLLER_TYPES,
        loop,
        sign=loop.controller.sign,
        lo=0.0,
        hi=100.0,
    )


def _plugin(
    folder: PluginFolder, part: Any, built_in: tuple[str, ...], loop: Loop, **more: float
) -> Any:
    if part.type in built_in:
        return None
    known = (*built_in, *folder.names())
    if part.type not in known:
        raise UnknownName(folder.kind, part.type, known)
    module = folder.load(part.type)
    where = f"{folder.kind} {part.type!r}"
    own = {k: v for k, v in (part.parameters or {}).items() if v is not None}
    more |= {"Ts": loop.sampling.Ts, "op0": loop.operating_point.op0, "pv0": loop.pv0}
    return module, resolve(module.PARAMETERS, own, where, getattr(module, "complete", None), **more)


def linear_plant(module: ModuleType, p: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return what a plug-in plant says of its transfer function; of one that has none what effects
    must leave as it is.
    """
    if not hasattr(module, "linear"):
        return np.array([1.0]), np.array([1.0, 1.0])
    return checked_polynomials(*map(list, module.linear(p)))


def stages_of(part: Part, Ts: float) -> list[tuple[ModuleType, Any]]:
    """Return the stages that OP passes in a valve, each a plug-in with its resolved parameters."""
    # `before` and `behind` are stages OP passes on its way: [{ model = "lag", T = 2.0 }, ...]
    own = {k: v for k, v in part.parameters.items() if k not in ("before", "behind")}
    chain = [*_stages(part, "before"), (part.name, own), *_stages(part, "behind")]
    modules = [(VALVES.load(name), parameters) for name, parameters in chain]
    return [(module, valve_parameters(module, parameters, Ts)) for module, parameters in modules]


def _stages(part: Part, place: str) -> list[tuple[str, dict[str, Any]]]:
    stages = part.parameters.get(place, [])
    if not isinstance(stages, list) or not all(
        isinstance(s, dict) and "model" in s for s in stages
    ):
        raise ParameterError(
            f"valve {part.name!r}: {place} = {stages!r}; a list of tables with a key model is"
            " needed"
        )
    return [(s["model"], {k: v for k, v in s.items() if k != "model"}) for s in stages]
