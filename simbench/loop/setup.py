"""Setup: a loop file resolved to numbers and arrays, which effects may change before the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from detectors.errors import ParameterError
from scenarios.spec import Loop, Part
from simbench.loop import controller, plant, sensor
from simbench.loop.parameters import VALVES, valve_parameters

_NOISE, MV_NOISE = 0, 1  # random streams of their own


@dataclass
class Setup:
    """Everything the compiled loop needs, still open to change.

    Signals have n + tail samples; loads are in % at the plant's input and in PV units at its output; `pv_add` is
    measured with PV (noise included). `valves` is the chain OP passes, each a plug-in with its resolved parameters.
    `recorders` turn the PV the controller saw into the PV that is archived.
    """

    loop: Loop
    seed: int
    tail: int
    num: np.ndarray
    den: np.ndarray
    Td: float
    Kc: float
    Ti: float | None
    op0: float
    pv0: float
    sp: np.ndarray
    load_in: np.ndarray
    load_out: np.ndarray
    noise_std: float
    pv_add: np.ndarray
    valves: list[tuple[ModuleType, Any]]
    op_lo: float = 0.0
    op_hi: float = 100.0
    error_gap: float = 0.0
    op_step: float = 0.0
    sensor_tau: float = 0.0
    pv_step: float = 0.0
    recorders: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)

    @property
    def Ts(self) -> float:
        """Sampling period (s)."""
        return self.loop.sampling.Ts

    @property
    def n(self) -> int:
        """Samples of the record, without the tail."""
        return self.loop.sampling.n

    @property
    def sign(self) -> float:
        """+1 for a reverse, -1 for a direct acting controller; effects change `Kc` without it."""
        return self.loop.controller.sign

    def add_valve(self, model: str | ModuleType, parameters: Mapping[str, Any], *, first: bool = False) -> None:
        """Put one more stage (a valve model's name, or a module like one) behind (or in front of) the valves that are there."""
        module = VALVES.load(model) if isinstance(model, str) else model
        stage = (module, valve_parameters(module, parameters, self.Ts))
        self.valves.insert(0, stage) if first else self.valves.append(stage)

    @property
    def resting_mv(self) -> float:
        """MV (%) at rest under OP = op0: what the chain of valves makes of it."""
        v = self.op0
        for module, p in self.valves:
            v = float(module.start(v, p)[0])
        return v

    @property
    def bands(self) -> list[tuple[float, float]]:
        """Mapped (S, J) in % of travel of every stage of the valve; (0, 0) of one that maps on none."""
        return [module.mapped_SJ(p) if hasattr(module, "mapped_SJ") else (0.0, 0.0) for module, p in self.valves]

    @property
    def sticky(self) -> bool:
        """Whether any stage of the valve has friction: what it maps on decides, not how it or its numbers are called."""
        return self.friction[0] > 0.0

    @property
    def friction(self) -> tuple[float, float]:
        """Mapped (S, J) in % of travel of the stickiest stage."""
        return max(self.bands, default=(0.0, 0.0))

    def draw_noise(self, quiet: int | None = None) -> None:
        """Draw the noise and add it to what is measured with PV, before sample `quiet`; last: effects change its strength."""
        if self.noise_std > 0:
            # from a stream of its own: a longer tail only appends
            white = np.random.default_rng([self.seed, _NOISE]).standard_normal(self.sp.size)
            self.pv_add[:quiet] += self.noise_std * white[:quiet]

    def hold(self, signal: np.ndarray) -> np.ndarray:
        """Freeze a signal at its last value over the tail."""
        signal[self.n :] = signal[self.n - 1]
        return signal


def plain_setup(loop: Loop, seed: int, tail: int = 0, tf: Any = None) -> Setup:
    """Turn a loop into a setup without disturbances, effects and noise.

    Parameters
    ----------
    loop : Loop
        What to run.
    seed : int
        Root of every random stream of the run.
    tail : int
        Further samples over which set point and disturbances are frozen.
    tf : control.TransferFunction, optional
        Takes the place of the loop's plant (its dead time stays).

    Returns
    -------
    Setup

    Raises
    ------
    UnknownName, ParameterError
        For a valve that does not exist, numbers it does not allow, or an unstable plant.
    """
    total = loop.sampling.n + tail
    num, den = plant.polynomials(loop.plant) if tf is None else plant.checked_polynomials(tf)
    if loop.controller.sign * num[0] / den[den != 0][-1] < 0:
        raise ParameterError("positive feedback: the plant's gain and the controller's direction have opposite signs")
    setup = Setup(
        loop=loop,
        seed=seed,
        tail=tail,
        num=num,
        den=den,
        Td=loop.plant.Td,
        Kc=loop.controller.Kc,
        Ti=loop.controller.Ti,
        op0=loop.operating_point.op0,
        pv0=loop.pv0,
        sp=np.full(total, loop.setpoint.value),
        load_in=np.zeros(total),
        load_out=np.zeros(total),
        noise_std=loop.noise.std,
        pv_add=np.zeros(total),
        valves=_valves(loop.valve, loop.sampling.Ts),
    )
    for t, value in sorted(loop.setpoint.steps):
        setup.sp[int(np.ceil(t / setup.Ts - 1e-9)) :] = value
    setup.hold(setup.sp)
    return setup


@dataclass(frozen=True)
class Parts:
    """The pieces of one run, as `simbench.loop.kernel` takes them.

    `steps` and `stages` are functions, `numbers` their parameters as named tuples: plant, controller, gap, sensor, and a tuple
    for the valve's stages.
    """

    sampled: plant.SampledPlant
    steps: dict[str, FunctionType]
    stages: tuple[FunctionType, ...]
    numbers: tuple

    @property
    def classes(self) -> tuple:
        """The named-tuple classes of `numbers`."""
        *fixed, stages = self.numbers
        return (*(type(p) for p in fixed), tuple(type(p) for p in stages))

    @property
    def bare(self) -> tuple:
        """`numbers` without their names."""
        *fixed, stages = self.numbers
        return (*(tuple(p) for p in fixed), tuple(tuple(p) for p in stages))


def parts_of(setup: Setup) -> Parts:
    """Choose the steps a setup needs, and resolve their parameters."""
    sampled = plant.sample(setup.num, setup.den, setup.Td, setup.Ts)
    first_order = sampled.order == 1
    if first_order:
        plant_p = plant.FirstOrder(float(sampled.A[0, 0]), float(sampled.B_old[0]), float(sampled.B_new[0]), setup.pv0)
    else:
        plant_p = plant.General(sampled.A, sampled.B_old, sampled.B_new, sampled.C, setup.pv0)
    gain = setup.sign * setup.Kc
    if setup.Ti is None:
        control_p = controller.P(gain, setup.op0, setup.op_lo, setup.op_hi)
    else:
        control_p = controller.PI(gain, gain * setup.Ts / setup.Ti, setup.op_lo, setup.op_hi)
    full_control = setup.error_gap > 0 or setup.op_step > 0
    full_sensor = setup.sensor_tau > 0 or setup.pv_step > 0
    follow = 1.0 - np.exp(-setup.Ts / setup.sensor_tau) if setup.sensor_tau > 0 else 1.0
    steps = {
        "error_step": controller.dead_error if full_control else controller.plain_error,
        "controller_step": controller.p_step if setup.Ti is None else controller.pi_step,
        "output_step": controller.coarse_output if full_control else controller.plain_output,
        "plant_step": plant.first_order_step if first_order else plant.general_step,
        "plant_output": plant.first_order_output if first_order else plant.general_output,
        "sensor_step": sensor.full_step if full_sensor else sensor.plain_step,
    }
    gap_p = controller.Gap(setup.error_gap / 2, setup.op_step) if full_control else controller.NoGap(0.0)
    sensor_p = sensor.Transmitter(float(follow), setup.pv_step) if full_sensor else sensor.Bare(0.0)
    valve_p = tuple(p for _, p in setup.valves)
    stages = tuple(module.step for module, _ in setup.valves)
    return Parts(sampled, steps, stages, (plant_p, control_p, gap_p, sensor_p, valve_p))


def _valves(part: Part, Ts: float) -> list[tuple[ModuleType, Any]]:
    # `before` and `behind` are stages OP passes on its way: [{ model = "lag", T = 2.0 }, ...]
    own = {k: v for k, v in part.parameters.items() if k not in ("before", "behind")}
    chain = [*_stages(part, "before"), (part.name, own), *_stages(part, "behind")]
    modules = [(VALVES.load(name), parameters) for name, parameters in chain]
    return [(module, valve_parameters(module, parameters, Ts)) for module, parameters in modules]


def _stages(part: Part, place: str) -> list[tuple[str, dict[str, Any]]]:
    stages = part.parameters.get(place, [])
    if not isinstance(stages, list) or not all(isinstance(s, dict) and "model" in s for s in stages):
        raise ParameterError(f"valve {part.name!r}: {place} = {stages!r}; a list of tables with a key model is needed")
    return [(s["model"], {k: v for k, v in s.items() if k != "model"}) for s in stages]
