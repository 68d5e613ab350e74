"""The linear plant and controller of a set-up loop, and the states that they start in."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import FunctionType
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop import controller, plant, sensor
from simbench.loop.elementary import dot, times
from simbench.loop.setup import Setup, linear_plant


@dataclass(frozen=True)
class Parts:
    """The pieces of one run, as `simbench.loop.kernel` takes them.

    `steps` and `stages` are functions, `numbers` their parameters as named tuples: plant,
    controller, gap, sensor, and a tuple for the valve's stages.
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
    # Plant and controller
    sampled, plant_steps, plant_p = _plant_of(setup)
    control_steps, control_p = _control_of(setup)

    # Error gap and rounded OP, sensor lag and rounded PV: the plain steps where there is none
    full_control = setup.error_gap > 0 or setup.op_step > 0
    full_sensor = setup.sensor_tau > 0 or setup.pv_step > 0
    if setup.sensor_tau > 0:
        follow = -math.expm1(-setup.Ts / setup.sensor_tau)
    else:
        follow = 1.0
    steps = {
        "error_step": controller.dead_error if full_control else controller.plain_error,
        **control_steps,
        "output_step": controller.coarse_output if full_control else controller.plain_output,
        **plant_steps,
        "sensor_step": sensor.full_step if full_sensor else sensor.plain_step,
    }

    # Their numbers
    if full_control:
        gap_p = controller.Gap(setup.error_gap / 2, setup.op_step)
    else:
        gap_p = controller.NoGap(0.0)
    if full_sensor:
        sensor_p = sensor.Transmitter(float(follow), setup.pv_step)
    else:
        sensor_p = sensor.Bare(0.0)

    # An effect on the law needs a plain P or PI controller
    if setup.derivative is not None or setup.idle is not None:
        if steps["controller_kick"] is not controller.kicked:
            raise ParameterError(
                f"an effect changes the law of controller {setup.loop.controller.type!r}, not of P"
                " or PI"
            )
        if setup.outer is not None:
            raise ParameterError(
                "an effect changes the inner controller's law of a cascade, whose SP the outer OP"
                " moves"
            )
        steps["controller_step"] = controller.other_step
        control_p = _other_pi(setup)

    # A sensor that freezes
    if setup.frozen is not None:
        steps["sensor_step"] = sensor.freezing_step
        sensor_p = sensor.Freezing(float(follow), setup.pv_step, setup.frozen)

    # The valve's stages
    valve_p = tuple(p for _, p in setup.valves)
    stages = tuple(module.step for module, _ in setup.valves)
    return Parts(sampled, steps, stages, (plant_p, control_p, gap_p, sensor_p, valve_p))


def _other_pi(setup: Setup) -> controller.OtherPI:
    """Return the numbers of a PI with a derivative, or with samples in which it does not run."""
    gain = setup.sign * setup.Kc
    Td, lag = setup.derivative or (0.0, 0.0)
    return controller.OtherPI(
        Kc=gain,
        Ki=gain * setup.Ts / setup.Ti if setup.Ti else 0.0,
        Kd=gain * Td / setup.Ts,
        follow=1.0 / (1.0 + lag / setup.Ts),
        lo=setup.op_lo,
        hi=setup.op_hi,
        moves=np.append(0.0, np.diff(setup.sp)),
        idle=np.zeros(setup.sp.size) if setup.idle is None else setup.idle,
    )


def in_series(inner: Setup, outer: Setup) -> Parts:
    """Return the parts of a cascade's outer loop as the valve drives it: behind the inner plant and
    its dead time.
    """
    num = np.polymul(inner.num, outer.num)
    den = np.polymul(inner.den, outer.den)
    return parts_of(replace(outer, num=num, den=den, Td=inner.Td + outer.Td))


def _plant_of(setup: Setup) -> tuple[plant.SampledPlant, dict[str, FunctionType], Any]:
    """Return the sampled plant, its steps and their numbers."""
    # A plug-in computes its own step; its transfer function is not changed
    if setup.plant_plugin is not None:
        module, p = setup.plant_plugin
        num, den = linear_plant(module, p)
        if not (np.array_equal(setup.num, num) and np.array_equal(setup.den, den)):
            raise ParameterError(
                f"an effect changes the transfer function of plant {setup.loop.plant.type!r}, which"
                f" is {'stated in powers of z' if setup.loop.plant.dt else 'a plug-in'}"
            )
        p = p._replace(Td=setup.Td, op0=setup.op0, pv0=setup.pv0)
        empty = np.zeros(0)
        sampled = plant.SampledPlant(
            np.zeros((0, 0)), empty, empty, empty, plant.whole_delay(setup.Td, setup.Ts)
        )
        return sampled, {"plant_step": module.step, "plant_output": plant.first_order_output}, p

    # A sampled plant of first, second, or any order
    sampled = plant.sample(setup.num, setup.den, setup.Td, setup.Ts)
    old = sampled.B_old.tolist()
    new = sampled.B_new.tolist()
    if sampled.order == 1:
        p = plant.FirstOrder(float(sampled.A[0, 0]), *old, *new, setup.pv0)
        return (
            sampled,
            {"plant_step": plant.first_order_step, "plant_output": plant.first_order_output},
            p,
        )
    if sampled.order == 2 and setup.loop.plant.type == "tf":
        p = plant.second_order(sampled, setup.den, setup.Ts, setup.pv0)
        return (
            sampled,
            {"plant_step": plant.second_order_step, "plant_output": plant.first_order_output},
            p,
        )
    p = plant.General(sampled.A, sampled.B_old, sampled.B_new, sampled.C, setup.pv0)
    return sampled, {"plant_step": plant.general_step, "plant_output": plant.general_output}, p


def _control_of(setup: Setup) -> tuple[dict[str, FunctionType], Any]:
    """Return the controller's steps and their numbers."""
    # A plug-in has the numbers that it names
    gain = setup.sign * setup.Kc
    limits = (setup.op_lo, setup.op_hi)
    if setup.control_plugin is not None:
        module, p = setup.control_plugin
        tuned = {}
        for k, v in (("Kc", setup.Kc), ("Ti", setup.Ti)):
            if v is not None and k in p._fields:
                tuned[k] = v
        if "Kc" not in tuned and setup.Kc != setup.loop.controller.Kc:
            raise ParameterError(
                f"an effect changes Kc, which controller {setup.loop.controller.type!r} does not"
                " have"
            )
        p = p._replace(**tuned, op0=setup.op0, pv0=setup.pv0, lo=limits[0], hi=limits[1])
        return {"controller_step": module.step, "controller_kick": controller.plugin_kicked}, p

    # P, PID and PI
    if setup.Ti is None:
        p = controller.P(gain, setup.op0, *limits)
        return {"controller_step": controller.p_step, "controller_kick": controller.kicked}, p
    if setup.loop.controller.type == "PID":
        p = controller.pid_numbers(
            setup.loop.controller, gain, setup.Ti, setup.Ts, setup.pv0, *limits
        )
        return {"controller_step": controller.pid_step, "controller_kick": controller.pid_kicked}, p
    p = controller.PI(gain, gain * setup.Ts / setup.Ti, *limits)
    return {"controller_step": controller.pi_step, "controller_kick": controller.kicked}, p


def control_start(setup: Setup, p: Any) -> tuple[Any, ...]:
    """Return the controller's state at rest: there the error is 0, and a set point away from pv0 is
    a step at sample 0.
    """
    if setup.derivative is not None or setup.idle is not None:
        return controller.other_start(setup.op0, 0.0)
    if setup.control_plugin is not None:
        return _numbers_in(setup.control_plugin[0].start(p))
    if setup.loop.controller.type == "PID" and setup.Ti is not None:
        return controller.pid_start(setup.op0, 0.0)
    return (controller.p_start if setup.Ti is None else controller.pi_start)(setup.op0, 0.0)


def plant_start(setup: Setup, parts: Parts, pv: float, state: tuple[float, ...] = ()) -> Any:
    """Return the plant's state: at rest, with PV at `pv` where it is of first order, or the one
    given.
    """
    # A plug-in says where it rests
    order = parts.sampled.order
    g = parts.sampled
    if setup.plant_plugin is not None:
        rest = _numbers_in(setup.plant_plugin[0].start(parts.numbers[0]))
        return (float(pv - setup.pv0),) + rest[1:]

    # A cycle's state is given, in the form of the plant's step
    second = parts.steps["plant_step"] is plant.second_order_step
    if state and second:
        moved = times(g.A, np.asarray(state)) - state
        return dot(g.C, state), dot(g.C, moved)
    if state:
        if order == 1:
            return state
        return np.append(state, np.zeros(order))

    # Else at rest
    if order == 1:
        return (float(pv - setup.pv0),)
    if second:
        return (0.0, 0.0)
    return np.zeros(2 * order)


def _numbers_in(state: tuple) -> tuple:
    """Return a plug-in's state with its numbers as floats; one in plain Python may hold other
    things too.
    """
    return tuple(float(x) if isinstance(x, (int, float, np.number)) else x for x in state)
