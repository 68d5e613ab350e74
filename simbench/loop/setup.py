"""Setup: a loop file resolved to numbers and arrays, which effects may change before the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from simbench.scenarios.parts import Outer, Part
from simbench.scenarios.plant import CONTROLLER_TYPES, PLANT_TYPES
from simbench.scenarios.polynomials import checked_polynomials
from simbench.scenarios.spec import Loop

# random streams of their own
_NOISE = 0
MV_NOISE = 1
_OUTER_NOISE = 2


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
    # A plant of the user's, a plug-in, or the loop file's
    if tf is None:
        own = _plant_plugin(loop)
    else:
        own = None
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

    # The parts as a simulation takes them
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
    return _load_part(PLANT_PLUGINS, loop.plant, PLANT_TYPES, loop, Td=loop.plant.Td)


def _control_plugin(loop: Loop) -> tuple[ModuleType, Any] | None:
    """Return a plug-in controller, or one in powers of z, and its numbers: its PARAMETERS, then
    sign, OP's limits, Ts (s), op0 (%) and pv0.
    """
    if loop.controller.dt is not None:
        return sampled_law, sampled_law.numbers(loop.controller)
    return _load_part(
        CONTROLLER_PLUGINS,
        loop.controller,
        CONTROLLER_TYPES,
        loop,
        sign=loop.controller.sign,
        lo=0.0,
        hi=100.0,
    )


def _load_part(
    folder: PluginFolder, part: Any, built_in: tuple[str, ...], loop: Loop, **more: float
) -> Any:
    # A part of the package, or a plug-in that is there
    if part.type in built_in:
        return None
    known = built_in + tuple(folder.names())
    if part.type not in known:
        raise UnknownName(folder.kind, part.type, known)

    # Its own parameters, and what the loop states of all
    module = folder.load(part.type)
    where = f"{folder.kind} {part.type!r}"
    own = {}
    for k, v in (part.parameters or {}).items():
        if v is not None:
            own[k] = v
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
    own = {}
    for k, v in part.parameters.items():
        if k not in ("before", "behind"):
            own[k] = v
    chain = _stages_of(part, "before") + [(part.name, own)] + _stages_of(part, "behind")
    modules = [(VALVES.load(name), parameters) for name, parameters in chain]
    return [(module, valve_parameters(module, parameters, Ts)) for module, parameters in modules]


def _stages_of(part: Part, place: str) -> list[tuple[str, dict[str, Any]]]:
    stages = part.parameters.get(place, [])
    if not isinstance(stages, list) or not all(
        isinstance(s, dict) and "model" in s for s in stages
    ):
        raise ParameterError(
            f"valve {part.name!r}: {place} = {stages!r}; a list of tables with a key model is"
            " needed"
        )
    return [(s["model"], {k: v for k, v in s.items() if k != "model"}) for s in stages]


@dataclass
class Setup:
    """Everything the compiled loop needs, still open to change; signals have end + tail samples,
    the warm-up included.
    """

    loop: Loop
    seed: int
    tail: int  # samples behind the record
    # the plant's transfer function, and its dead time (s); nothing of a plug-in that has none
    num: np.ndarray
    den: np.ndarray
    Td: float
    Kc: float  # %/PV unit, without the controller's sign
    Ti: float | None  # s; None of a P controller
    op0: float  # operating point: OP (%) and PV at rest
    pv0: float
    sp: np.ndarray
    load_in: np.ndarray  # at the plant's input (%)
    load_out: np.ndarray  # at its output (PV units)
    op_moves: np.ndarray  # of OP, which the controller does not make and goes on from (%)
    noise_std: float  # PV units
    pv_add: np.ndarray  # what is measured with PV, its noise included (PV units)
    # the chain that OP passes, each stage a plug-in with its resolved parameters
    valves: list[tuple[ModuleType, Any]]
    op_lo: float = 0.0  # limits of OP (%)
    op_hi: float = 100.0
    error_gap: float = 0.0  # full width of the error (PV units) in which OP rests
    op_step: float = 0.0  # of OP's lattice (%)
    sensor_tau: float = 0.0  # s
    pv_step: float = 0.0  # of the lattice on which the controller sees PV (PV units)
    # what turns the PV the controller saw into the PV that is archived
    recorders: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)
    outer: Setup | None = None  # the outer loop of a cascade
    outer_signals: tuple[np.ndarray, np.ndarray] | None = None
    plant_plugin: tuple[ModuleType, Any] | None = None  # with its resolved parameters
    control_plugin: tuple[ModuleType, Any] | None = None
    derivative: tuple[float, float] | None = None  # of a P or PI controller: time and filter (s)
    idle: np.ndarray | None = None  # 1 where a P or PI controller does not run
    frozen: np.ndarray | None = None  # 1 where the sensor's reading stands

    @property
    def Ts(self) -> float:
        """Sampling period (s)."""
        return self.loop.sampling.Ts

    @property
    def warm_up(self) -> int:
        """Samples simulated before the record begins."""
        return self.loop.sampling.warm_up or 0

    @property
    def end(self) -> int:
        """Sample at which the record ends and the tail begins, counted from the start of the
        run.
        """
        return self.warm_up + self.loop.sampling.n

    @property
    def sign(self) -> float:
        """+1 for a reverse, -1 for a direct acting controller; effects change `Kc` without it."""
        return self.loop.controller.sign

    def add_valve(
        self, model: str | ModuleType, parameters: Mapping[str, Any], *, first: bool = False
    ) -> None:
        """Put one more stage (a valve model's name, or a module like one) behind (or in front of)
        the valves that are there.
        """
        if isinstance(model, str):
            module = VALVES.load(model)
        else:
            module = model
        stage = (module, valve_parameters(module, parameters, self.Ts))
        self.valves.insert(0, stage) if first else self.valves.append(stage)

    @property
    def integrating(self) -> bool:
        """Whether the plant integrates."""
        if self.loop.plant.dt is not None:
            return self.loop.plant.integrating
        if self.plant_plugin is not None:
            return bool(self.plant_plugin[0].INTEGRATING)
        return bool(self.den[-1] == 0)

    @property
    def not_linear(self) -> str:
        """Why the loop has no transfer function from MV back to OP, in words; "" where it has
        one.
        """
        # Parts without a transfer function
        if self.outer is not None:
            return "the loop is the inner one of a cascade"
        for name, part in (("plant", self.loop.plant), ("controller", self.loop.controller)):
            if part.dt is not None:
                return f"its {name} is stated in powers of z"
        if self.plant_plugin is not None and not hasattr(self.plant_plugin[0], "linear"):
            return f"plant {self.loop.plant.type!r} has no transfer function"
        if self.control_plugin is not None:
            return f"controller {self.loop.controller.type!r} is a law of its own"

        # A gain that changes with the signal
        return (
            "the controller's gain follows a schedule"
            if self.loop.controller.schedule is not None
            else ""
        )

    @property
    def resting_mv(self) -> float:
        """MV (%) at rest under OP = op0: what the chain of valves makes of it."""
        return resting_mv(self.valves, self.op0)

    @property
    def bands(self) -> list[tuple[float, float]]:
        """Mapped (S, J) in % of travel of every stage of the valve; (0, 0) of one that maps on
        none.
        """
        return bands_of(self.valves)

    @property
    def sticky(self) -> bool:
        """Whether any stage of the valve has friction: what it maps on decides, not how it or its
        numbers are called.
        """
        return self.friction[0] > 0.0

    @property
    def friction(self) -> tuple[float, float]:
        """Mapped (S, J) in % of travel of the stickiest stage."""
        return max(self.bands, default=(0.0, 0.0))

    def draw_noise(self, quiet: int | None = None) -> None:
        """Draw the noise and add it to what is measured with PV, before sample `quiet` of the
        record.

        Last of all, because effects change its strength.
        """
        if quiet is None:
            quiet = None
        else:
            quiet = self.warm_up + quiet
        if self.noise_std > 0:
            # from a stream of its own: a longer tail only appends
            white = np.random.default_rng([self.seed, _NOISE]).standard_normal(self.sp.size)
            self.pv_add[:quiet] += self.noise_std * white[:quiet]
        if self.outer is not None and self.outer.noise_std > 0:
            white = np.random.default_rng([self.seed, _OUTER_NOISE]).standard_normal(self.sp.size)
            self.outer.pv_add[:quiet] = self.outer.noise_std * white[:quiet]

    def add_load(self, place: str, signal: np.ndarray) -> None:
        """Add a load at the plant's "input" or "output" up to the record's end, which stands still
        from there on, or what it does to OP ("op").
        """
        if place == "op":
            self.op_moves[: self.end] += np.diff(signal, prepend=0.0)
            return
        load = self.load_in if place == "input" else self.load_out
        load[: self.end] += signal
        load[self.end :] += signal[-1]

    def hold(self, signal: np.ndarray) -> np.ndarray:
        """Freeze a signal at its last value over the tail."""
        signal[self.end :] = signal[self.end - 1]
        return signal


def resting_mv(valves: Sequence[tuple[ModuleType, Any]], op0: float) -> float:
    """Return MV (%) at rest under OP = op0: what a chain of valves makes of it."""
    v = op0
    for module, p in valves:
        v = float(module.start(v, p)[0])
    return v


def bands_of(valves: Sequence[tuple[ModuleType, Any]]) -> list[tuple[float, float]]:
    """Return mapped (S, J) in % of travel of every stage of a valve; (0, 0) of one that maps on
    none.
    """
    return [
        module.mapped_SJ(p) if hasattr(module, "mapped_SJ") else (0.0, 0.0) for module, p in valves
    ]


def plain_setup(
    loop: Loop, seed: int, tail: int = 0, tf: Any = None, parts: LoopParts | None = None
) -> Setup:
    """Turn a loop into a setup without disturbances, effects and noise; set point and disturbances
    stand still over the tail.

    `tf` takes the place of the loop's plant (its dead time stays); `parts` are those of the loop,
    where they are known.
    """
    # The parts of the loop, looked up once
    total = (loop.sampling.warm_up or 0) + loop.sampling.n + tail
    parts = parts or look_up_parts(loop, tf)

    # Everything at rest, over all samples
    setup = Setup(
        loop=loop,
        seed=seed,
        tail=tail,
        num=parts.num,
        den=parts.den,
        Td=loop.plant.Td,
        Kc=loop.controller.Kc,
        Ti=loop.controller.Ti,
        op0=loop.operating_point.op0,
        pv0=loop.pv0,
        sp=np.full(total, loop.setpoint.value),
        load_in=np.zeros(total),
        load_out=np.zeros(total),
        op_moves=np.zeros(total),
        noise_std=loop.noise.std,
        pv_add=np.zeros(total),
        valves=list(parts.valves),
        plant_plugin=parts.plant_plugin,
        control_plugin=parts.control_plugin,
    )

    # Set points, and the master of a cascade
    _set_up_steps(setup, loop.setpoint.steps)
    if loop.outer is not None:
        setup.outer = _set_up_outer(setup, loop.outer)
    return setup


def _set_up_steps(setup: Setup, steps: Sequence[tuple[float, float]]) -> None:
    if steps:
        times, values = np.array(sorted(steps)).T
        # of the steps before a sample the last one holds
        first = np.ceil(times / setup.Ts - 1e-9)
        last = np.searchsorted(first, np.arange(setup.sp.size), side="right") - 1
        setup.sp[:] = np.where(last < 0, setup.sp, values[last])
    setup.hold(setup.sp)


def _set_up_outer(inner: Setup, outer: Outer) -> Setup:
    """Return the outer loop of a cascade, its plant without that of the inner loop, OP at rest
    where the inner PV rests.
    """
    # The master moves the inner set point, whose loop must be linear
    if inner.not_linear:
        raise ParameterError(
            f"cascade: {inner.not_linear}; the inner loop of a cascade needs a plant with a"
            " transfer function"
        )

    # The master's own plant, OP at the inner set point
    num, den = plant.polynomials(outer.plant)
    lo, hi = outer.sp_span
    alone = {
        "plant": outer.plant,
        "controller": outer.controller,
        "setpoint": outer.setpoint,
        "outer": None,
    }
    setup = replace(
        inner,
        loop=inner.loop.model_copy(update=alone),
        num=num,
        den=den,
        Td=outer.plant.Td,
        Kc=outer.controller.Kc,
        Ti=outer.controller.Ti,
        op0=100.0 * (inner.pv0 - lo) / (hi - lo),
        pv0=outer.setpoint.value,
        sp=np.full(inner.sp.size, outer.setpoint.value),
        noise_std=outer.noise.std,
        pv_add=np.zeros(inner.sp.size),
        valves=[],
        recorders=[],
    )

    # Set points of the master
    _set_up_steps(setup, outer.setpoint.steps)
    return setup
