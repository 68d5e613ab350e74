"""How large a foreign fault can be: a family of parameters for each, as in `sizes`."""

from __future__ import annotations

from collections.abc import Callable

from results.studies.worlds.mill.loops import either, logu
from results.studies.worlds.mill.scales import limits
from simbench.detectors.errors import ParameterError


def _scan_overrun(rng, s):
    length, scans = s.length / logu(rng, 5.0, 40.0), float(rng.integers(2, 13))
    return 0.01, 0.95, lambda x: {"share": x, "length": length, "scans": scans}


def _steam_feedforward(rng, s):
    if s.case["load"]["std"] == 0.0:
        raise ParameterError("steam_feedforward needs a load")
    return 0.1, 2.5, lambda x: {"gain": x}


def _manual_spells(rng, s):
    length = s.length / logu(rng, 8.0, 60.0)
    return 0.02, 0.7, lambda x: {"share": x, "length": length}


def _stroke_speed(rng, s):
    most = 3.0 * s.move / s.case["Ts"]
    return 1.0, 300.0, lambda x: {"rate": most / x}


def _travel_stop(rng, s):
    return limits(s, int(rng.integers(2)))


def _ringing(rng, s):
    damping = rng.uniform(0.06, 0.25)
    return 2.5 * s.case["Ts"], 10.0 * s.pace, lambda x: {"period": x, "damping": damping}


def _shrink_swell(rng, s):
    return 0.2 * s.pace, 8.0 * s.pace, lambda x: {"lead": x}


def _titration(rng, s):
    shape = either(rng)
    return 0.3, 300.0, lambda x: {"width": 3.0 * s.error / x, "shape": shape}


def _white_water(rng, s):
    delay = max(s.pace * logu(rng, 1.5, 10.0), 2.0 * s.case["Ts"])
    return 0.1, 0.95, lambda x: {"share": x, "delay": delay}


def _frozen_spells(rng, s):
    length = max(4.0 * s.case["Ts"], s.pace * logu(rng, 0.3, 3.0))
    return 0.01, 0.8, lambda x: {"share": x, "length": length}


def _scanner_hold(rng, s):
    samples = round(logu(rng, 8.0, min(120.0, s.case["n"] / 15.0)))
    return 1.5 / samples, 0.95, lambda x: {"cycle": samples * s.case["Ts"], "held": x}


def _entrained_air(rng, s):
    rate, length = logu(rng, 8.0, 60.0) / s.length, s.case["Ts"] * logu(rng, 2.5, 12.0)
    return 1.0 * s.noise, 60.0 * s.error, lambda x: {"rate": rate, "depth": x, "length": length}


def _backwash(rng, s):
    period = min(s.pace * logu(rng, 8.0, 40.0), s.length / 5.0)
    duty = rng.uniform(0.05, 0.25)
    return 0.1, 40.0, lambda x: {"height": x, "period": period, "duty": duty}


def _surge(rng, s):
    period, cycles = max(4.0 * s.case["Ts"], s.pace * logu(rng, 0.2, 2.0)), rng.uniform(4.0, 12.0)
    rate = logu(rng, 5.0, 30.0) / s.length
    return (
        0.5 * s.noise,
        60.0 * s.error,
        lambda x: {"amplitude": x, "period": period, "cycles": cycles, "rate": rate},
    )


FAMILIES: dict[str, Callable] = {
    "scan_overrun": _scan_overrun,
    "steam_feedforward": _steam_feedforward,
    "manual_spells": _manual_spells,
    "stroke_speed": _stroke_speed,
    "travel_stop": _travel_stop,
    "positioner_ringing": _ringing,
    "shrink_swell": _shrink_swell,
    "header_resonance": _ringing,
    "titration": _titration,
    "white_water_recycle": _white_water,
    "frozen_spells": _frozen_spells,
    "scanner_hold": _scanner_hold,
    "entrained_air": _entrained_air,
    "backwash_pulses": _backwash,
    "surge_bursts": _surge,
}
