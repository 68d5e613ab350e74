"""What each of the 22 effects does to the loop or to the record, by the vocabulary's
definitions.

Mismatches multiply (or add to) the plant of the case. Where a mismatch is the truth, the case's
plant agrees with the baseline in that very number, so that the parameter is the ratio to the
baseline, as in the vocabulary.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds.refinery import loads, valves
from results.studies.worlds.refinery.simulation import Setup
from simbench.detectors.errors import ParameterError
from simbench.loop.effects import Choice

Apply = Callable[[Setup, dict, dict], None]


def complete(effect: str, parameters: dict, case: dict) -> dict:
    """Return every parameter of an effect, absent ones at identity, each inside the vocabulary's
    bounds.
    """
    known = WORLD_EFFECTS[effect].parameters
    for name in parameters:
        if name not in known:
            raise ParameterError(f"{effect}: unknown parameter {name!r}; known: {', '.join(known)}")
    full = {
        **WORLD_EFFECTS[effect].identity,
        **({"c": case["m0"]} if effect == "deadzone" else {}),
        **parameters,
    }
    for name, value in full.items():
        rule = known[name]
        if isinstance(rule, Choice):
            if value not in rule.names:
                raise ParameterError(
                    f"{effect}: {name} = {value!r}; allowed: {', '.join(rule.names)}"
                )
        elif not rule.low <= value <= rule.high:
            raise ParameterError(
                f"{effect}: {name} = {value!r} is outside {rule.low:g}..{rule.high:g} {rule.unit}"
            )
    return full


def stiction(setup: Setup, p: dict, case: dict) -> None:
    """Friction by the loop's model; a jump beyond S exists in the data-driven models only."""
    S, J, friction = p["S"], p["J"], case["friction"]
    if S == 0.0 and J == 0.0:
        return
    model = valves.FRICTION.index(friction["model"])
    physical = model >= valves.KARNOPP
    if J > S or (physical and S - J < 0.04 * S):
        model, physical = valves.CHOUDHURY, False
    time = friction["travel_time"]
    setup.valve = setup.valve._replace(
        friction=model,
        fs=(S + J) / 2.0,
        fd=(S - J) / 2.0,
        travel_time=time,
        stribeck_speed=friction["stribeck"] * max(J, 0.05 * S) / time,
        slip_end=friction["slip_end"] * S,
        bristle=friction["bristle"] * S,
    )


def deadband(setup: Setup, p: dict, case: dict) -> None:
    """Backlash."""
    setup.valve = setup.valve._replace(play=float(p["S"]))


def deadzone(setup: Setup, p: dict, case: dict) -> None:
    """Zone around c."""
    setup.valve = setup.valve._replace(zone=float(p["D"]), zone_centre=float(p["c"]))


def valve_lag(setup: Setup, p: dict, case: dict) -> None:
    """Lag between stem and flow."""
    setup.valve = setup.valve._replace(lag=setup.valve.lag + float(p["tau"]))


def valve_characteristic(setup: Setup, p: dict, case: dict) -> None:
    """Inherent characteristic; the controller's rest moves to the travel that gives the balance
    flow.
    """
    setup.valve = setup.valve._replace(R=float(p["R"]))


def gain_mismatch(setup: Setup, p: dict, case: dict) -> None:
    """Another K."""
    setup.plant = setup.plant._replace(K=setup.plant.K * p["factor"])


def time_constant_mismatch(setup: Setup, p: dict, case: dict) -> None:
    """Another T; an integrating plant has none."""
    if setup.plant.integrating:
        if p["factor"] == 1.0:
            return
        raise ParameterError(
            f"time_constant_mismatch: factor = {p['factor']!r} needs a foptd plant; this one"
            " integrates"
        )
    setup.plant = setup.plant._replace(T=setup.plant.T * p["factor"])


def dead_time_mismatch(setup: Setup, p: dict, case: dict) -> None:
    """Another Td, cut at 0."""
    setup.plant = setup.plant._replace(Td=max(setup.plant.Td + p["extra"], 0.0))


def extra_lag(setup: Setup, p: dict, case: dict) -> None:
    """Second time constant before the noise."""
    setup.plant = setup.plant._replace(extra_lag=float(p["tau"]))


def noise(setup: Setup, p: dict, case: dict) -> None:
    """White noise on top of the loop's noise; a factor below 1 scales that down."""
    std0, factor = setup.noise_std, p["factor"]
    if factor < 1.0:
        setup.noise_std = std0 * factor
    setup.white_std = math.sqrt(max(factor**2 - 1.0, 0.0) * std0**2 + p["std"] ** 2)


def quantisation(setup: Setup, p: dict, case: dict) -> None:
    """Lattice through 0, in the transmitter or in the archive."""
    if p["at"] == "loop":
        setup.sensor = setup.sensor._replace(quantum=float(p["step"]))
    else:
        setup.record_quantum = float(p["step"])


def sensor_lag(setup: Setup, p: dict, case: dict) -> None:
    """Filter on the noisy PV."""
    setup.sensor = setup.sensor._replace(lag=setup.sensor.lag + float(p["tau"]))


def compression(setup: Setup, p: dict, case: dict) -> None:
    """Swinging door on the record."""
    setup.door = float(p["band"])


def outliers(setup: Setup, p: dict, case: dict) -> None:
    """Spikes, in the archive or in the loop."""
    hit = (float(p["rate"]), float(p["size"])) if p["size"] > 0.0 else (0.0, 0.0)
    if p["at"] == "loop":
        setup.spikes_loop = hit
    else:
        setup.spikes_record = hit


def drift(setup: Setup, p: dict, case: dict) -> None:
    """Slow error of the reading."""
    setup.drift = (float(p["rate"]), float(p["walk"]))


def oscillation(setup: Setup, p: dict, case: dict) -> None:
    """Sine of random phase."""
    amplitude, period = p["amplitude"], p["period"]
    if amplitude > 0.0:
        if period <= 0.0:
            raise ParameterError(f"oscillation: period = {period!r} s; allowed: above 0")
        setup.loads.append(
            lambda rng, n, h, _: (
                amplitude * np.sin(2 * np.pi * (np.arange(n) * h / period + rng.random()))
            )
        )


def load_steps(setup: Setup, p: dict, case: dict) -> None:
    """New level at Poisson times."""
    if p["rate"] > 0.0 and p["size"] > 0.0:
        setup.loads.append(lambda rng, n, h, _: p["size"] * loads.jumps(rng, n, h, p["rate"]))


def load_drift(setup: Setup, p: dict, case: dict) -> None:
    """Ramp and walk."""
    if p["rate"] != 0.0 or p["walk"] > 0.0:
        setup.loads.append(
            lambda rng, n, h, middle: loads.wander(rng, n, h, p["rate"], p["walk"], middle)
        )


def saturation(setup: Setup, p: dict, case: dict) -> None:
    """Tighter limits of OP."""
    if p["lo"] >= p["hi"]:
        raise ParameterError(f"saturation: lo = {p['lo']!r} % must lie below hi = {p['hi']!r} %")
    setup.controller = setup.controller._replace(lo=float(p["lo"]), hi=float(p["hi"]))


def detuning(setup: Setup, p: dict, case: dict) -> None:
    """Other tuning in the plant's controller."""
    c = setup.controller
    if c.Ti == 0.0 and p["Ti_factor"] != 1.0:
        raise ParameterError(
            f"detuning: Ti_factor = {p['Ti_factor']!r} needs a PI controller; this one is P"
        )
    setup.controller = c._replace(Kc=c.Kc * p["Kc_factor"], Ti=c.Ti * p["Ti_factor"])


def error_deadband(setup: Setup, p: dict, case: dict) -> None:
    """Error counts as 0 inside."""
    setup.controller = setup.controller._replace(dead_width=float(p["width"]))


def op_quantisation(setup: Setup, p: dict, case: dict) -> None:
    """Lattice of OP."""
    setup.controller = setup.controller._replace(quantum=float(p["step"]))


APPLY: dict[str, Apply] = {
    f.__name__: f
    for f in (
        stiction,
        deadband,
        deadzone,
        valve_lag,
        valve_characteristic,
        gain_mismatch,
        time_constant_mismatch,
        dead_time_mismatch,
        extra_lag,
        noise,
        quantisation,
        sensor_lag,
        compression,
        outliers,
        drift,
        oscillation,
        load_steps,
        load_drift,
        saturation,
        detuning,
        error_deadband,
        op_quantisation,
    )
}
