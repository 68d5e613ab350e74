"""Faults of refinery practice that the vocabulary has no word for: what each does, with its own
parameters.

None is an effect of the vocabulary under another name: each is nonlinear, episodic or of another
structure where the nearest effect is linear, stationary or first order. Sources: Shinskey, Process
Control Systems (1996) for error-squared averaging level control and inverse response; Kister,
Distillation Operation (1990) and Luyben, Plantwide Process Control (1998) for recycles and column
dynamics; Liptak, Instrument Engineers' Handbook for displacers, impulse lines, actuators.
"""

from __future__ import annotations

import numpy as np

from results.studies.worlds.refinery import loads
from results.studies.worlds.refinery.effects import Apply
from results.studies.worlds.refinery.simulation import Setup
from simbench.detectors.errors import ParameterError

FOREIGN: dict[str, str] = {
    "error_squared": "controller",  # averaging level control: gain grows with |error|
    "hidden_derivative": "controller",  # derivative action on PV that the documents do not know
    "one_way_ramp": "controller",  # anti-surge practice: opens at will, closes at a fixed ramp
    "manual_episodes": "controller",  # the operator takes the loop in hand and gives it back
    "stroke_speed_limit": "valve",  # starved air supply: largest stroking speed
    # coke or a forgotten handwheel: the stem stops, the integral does not
    "jammed_travel": "valve",
    "inverse_response": "process",  # shrink and swell: a fast opposite path
    "asymmetric_response": "process",  # heating and cooling with different time constants
    "heat_recycle": "process",  # feed-effluent exchanger: part of the output comes back later
    "plugged_line_freeze": "sensor",  # impulse line that plugs and clears: the reading is frozen
    # displacer that rubs in its cage: the reading reverses only after a lost travel
    "sticking_float": "sensor",
    "range_clip": "sensor",  # upper or lower range value too tight
    "slug_flow": "disturbance",  # slow build-ups with sudden ends, irregular
    "rain_bursts": "disturbance",  # showers on air coolers: episodes of strong load
}

# kinds that sites of `worlds.nuisances` have besides
MORE: dict[str, str] = {
    "missed_scans": "controller",  # an overloaded processor: OP stands for a few scans
    "zero_shift": "sensor",  # a loose terminal, a bumped transmitter: PV jumps and stays there
}
EVERY = FOREIGN | MORE

# parameter -> unit, lowest, highest
PARAMETERS: dict[str, dict[str, tuple[str, float, float]]] = {
    "error_squared": {"share": ("-", 0.0, 1.0), "error_of_full_gain": ("PV units", 1e-12, 1e9)},
    "hidden_derivative": {"Td": ("s", 0.0, 1e9)},
    "one_way_ramp": {"close_rate": ("%/s", 0.0, 1e9)},
    "manual_episodes": {"length": ("samples", 1.0, 1e6), "share": ("-", 0.0, 0.9)},
    "stroke_speed_limit": {"speed": ("%/s", 0.0, 1e9)},
    "jammed_travel": {"lo": ("%", 0.0, 100.0), "hi": ("%", 0.0, 100.0)},
    "inverse_response": {"gain": ("-", 0.0, 20.0), "tau": ("s", 1e-9, 1e9)},
    "asymmetric_response": {"ratio": ("-", 0.02, 50.0)},
    "heat_recycle": {"share": ("-", 0.0, 0.95), "delay": ("s", 0.0, 1e9)},
    "plugged_line_freeze": {"length": ("samples", 1.0, 1e6), "share": ("-", 0.0, 0.9)},
    "sticking_float": {"width": ("PV units", 0.0, 1e9)},
    "range_clip": {"lo": ("PV units", -1e18, 1e18), "hi": ("PV units", -1e18, 1e18)},
    "slug_flow": {
        "amplitude": ("%", 0.0, 100.0),
        "period": ("s", 1e-9, 1e9),
        "jitter": ("-", 0.0, 0.5),
    },
    "rain_bursts": {
        "std": ("%", 0.0, 100.0),
        "time": ("s", 1e-9, 1e9),
        "length": ("s", 1e-9, 1e9),
        "share": ("-", 0.01, 0.9),
    },
    "missed_scans": {
        "length": ("scans", 1.0, 1e6),
        "share": ("-", 0.0, 0.9),
        "tracks": ("1 = in velocity form it goes on from PV as it is", 0.0, 1.0),
    },
    "zero_shift": {"rate": ("1/s", 0.0, 1e9), "size": ("PV units", 0.0, 1e9)},
}


def check(kind: str, parameters: dict) -> dict:
    """Return the parameters of a foreign kind, complete and inside their bounds."""
    known = PARAMETERS[kind]
    if set(parameters) != set(known):
        raise ParameterError(f"{kind}: parameters {sorted(parameters)}; needed: {', '.join(known)}")
    for name, value in parameters.items():
        unit, low, high = known[name]
        if not low <= value <= high:
            raise ParameterError(f"{kind}: {name} = {value!r} is outside {low:g}..{high:g} {unit}")
    return parameters


def error_squared(setup: Setup, p: dict, case: dict) -> None:
    """Shinskey's blend: e (1 - share + share |e|/e_full)."""
    setup.controller = setup.controller._replace(
        square_share=float(p["share"]), square_scale=float(p["error_of_full_gain"])
    )


def hidden_derivative(setup: Setup, p: dict, case: dict) -> None:
    """Derivative on PV, filtered with Td/8, beside the one that is known."""
    setup.controller = setup.controller._replace(Td=setup.controller.Td + float(p["Td"]))


def one_way_ramp(setup: Setup, p: dict, case: dict) -> None:
    """OP may fall no faster than this; 0 = not limited."""
    setup.controller = setup.controller._replace(close_rate=float(p["close_rate"]))


def manual_episodes(setup: Setup, p: dict, case: dict) -> None:
    """OP rests for episodes."""
    setup.manual = (float(p["length"]), float(p["share"]))


def stroke_speed_limit(setup: Setup, p: dict, case: dict) -> None:
    """Same speed both ways; 0 = not limited."""
    setup.valve = setup.valve._replace(speed=float(p["speed"]))


def jammed_travel(setup: Setup, p: dict, case: dict) -> None:
    """The stem stays between two stops that the controller does not know."""
    setup.valve = setup.valve._replace(stop_lo=float(p["lo"]), stop_hi=float(p["hi"]))


def inverse_response(setup: Setup, p: dict, case: dict) -> None:
    """K (1 + gain)/(T s + 1) - K gain/(tau s + 1); integrating: K/s - K gain tau/(tau s + 1)."""
    setup.plant = setup.plant._replace(swell=float(p["gain"]), swell_time=float(p["tau"]))


def asymmetric_response(setup: Setup, p: dict, case: dict) -> None:
    """T sqrt(ratio) when PV falls, T/sqrt(ratio) when it rises."""
    if setup.plant.integrating:
        raise ParameterError("asymmetric_response needs a foptd plant; this one integrates")
    setup.plant = setup.plant._replace(
        T=setup.plant.T / float(np.sqrt(p["ratio"])), slower=float(p["ratio"])
    )


def heat_recycle(setup: Setup, p: dict, case: dict) -> None:
    """The steady gain stays K; the share comes back after the delay, so that the response climbs in
    stairs.
    """
    if setup.plant.integrating:
        raise ParameterError("heat_recycle needs a foptd plant; this one integrates")
    setup.plant = setup.plant._replace(recycle=float(p["share"]), recycle_delay=float(p["delay"]))


def plugged_line_freeze(setup: Setup, p: dict, case: dict) -> None:
    """The reading holds its last value for episodes; controller and record see it."""
    setup.frozen = (float(p["length"]), float(p["share"]))


def sticking_float(setup: Setup, p: dict, case: dict) -> None:
    """Backlash between process and reading, before the noise."""
    setup.sensor = setup.sensor._replace(float_play=float(p["width"]))


def range_clip(setup: Setup, p: dict, case: dict) -> None:
    """The reading stays inside its range; controller and record see it."""
    setup.sensor = setup.sensor._replace(clip_lo=float(p["lo"]), clip_hi=float(p["hi"]))


def slug_flow(setup: Setup, p: dict, case: dict) -> None:
    """Irregular sawtooth load."""
    setup.loads.append(
        lambda rng, n, h, _: p["amplitude"] * loads.sawtooth(rng, n, h, p["period"], p["jitter"])
    )


def rain_bursts(setup: Setup, p: dict, case: dict) -> None:
    """Load that is strong during episodes and absent between them."""

    def burst(rng: np.random.Generator, n: int, h: float, middle: int) -> np.ndarray:
        wet = loads.gate(rng, n, p["length"] / h, p["share"])
        return p["std"] * wet * loads.ornstein_uhlenbeck(rng, n, h, p["time"])

    setup.loads.append(burst)


def missed_scans(setup: Setup, p: dict, case: dict) -> None:
    """The controller does not run for spells of scans."""
    setup.missed = (float(p["length"]), float(p["share"]), bool(p["tracks"]))


def zero_shift(setup: Setup, p: dict, case: dict) -> None:
    """The reading's error is a new one at Poisson times; controller and record see it."""
    setup.shifts = (float(p["rate"]), float(p["size"]))


APPLY: dict[str, Apply] = {kind: globals()[kind] for kind in EVERY}
