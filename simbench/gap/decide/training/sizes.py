"""From x in 0..1 to the parameters of each effect: barely to grossly present, in proportion to the loop it acts in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from detectors.record import LoopRecord
from simbench.gap.decide.training.bench import Bench

Size = Callable[[float], dict[str, float | str]]
MODELS = {"choudhury": 0.3, "kano": 0.2, "he": 0.2, "karnopp": 0.15, "stribeck": 0.15}  # frictions, and how often


@dataclass(frozen=True, eq=False)
class Scales:
    """How large things are in a loop: its bench, and one record of it without effect."""

    bench: Bench
    record: LoopRecord

    @property
    def op(self) -> float:
        """Standard deviation of OP (%)."""
        return max(float(self.record.op.std()), 0.05)

    @property
    def op_change(self) -> float:
        """Standard deviation of OP from sample to sample (%)."""
        return max(float(np.diff(self.record.op).std()), 1e-3)

    @property
    def pv(self) -> float:
        """Robust standard deviation of the control error (PV units)."""
        e = self.record.e
        return 1.4826 * float(np.median(np.abs(e - np.median(e))))

    @property
    def noise(self) -> float:
        """Standard deviation of the measurement noise (PV units)."""
        return self.bench.loop.noise.std

    @property
    def seconds(self) -> float:
        """Length of the record (s)."""
        return self.record.duration

    @property
    def lag(self) -> float:
        """T + Td of the plant (s)."""
        return self.bench.scale + self.bench.loop.plant.Td


def between(x: float, low: float, high: float) -> float:
    """Return low at x = 0, high at x = 1, geometrically in between."""
    return float(low * (high / low) ** x)


def size_of(effect: str, s: Scales, rng: np.random.Generator) -> Size:
    """Draw all that is not size (direction, place, model, shape) and return the effect's parameters as a function of x.

    Parameters
    ----------
    effect : str
        Effect id.
    s : Scales
    rng : numpy.random.Generator

    Returns
    -------
    function
        x in 0..1 to a table of parameters; "model" beside S and J is the friction that makes a stiction.
    """
    return _SIZES[effect](s, rng)


def _stiction(s: Scales, rng: np.random.Generator) -> Size:
    model = str(rng.choice(list(MODELS), p=list(MODELS.values())))
    ratio = float(rng.uniform(0.1, 1.15 if model in ("choudhury", "kano") else 1.0))

    def size(x: float) -> dict[str, float | str]:
        S = min(between(x, 0.2 * s.op, 20 * s.op), 25.0)
        return {"S": S, "J": ratio * S, "model": model}

    return size


def _deadband(s: Scales, rng: np.random.Generator) -> Size:
    return lambda x: {"S": min(between(x, 0.2 * s.op, 30 * s.op), 30.0)}


def _deadzone(s: Scales, rng: np.random.Generator) -> Size:
    c = float(np.clip(s.record.op.mean() + s.op * rng.normal(), 5, 95))
    return lambda x: {"D": min(between(x, 0.2 * s.op, 15 * s.op), 20.0), "c": c}


def _lag(s: Scales, rng: np.random.Generator) -> Size:
    return lambda x: {"tau": between(x, 0.03, 8.0) * s.lag}


def _valve_characteristic(s: Scales, rng: np.random.Generator) -> Size:
    way = rng.choice([-1, 1])
    return lambda x: {"R": between(x, 1.15, 90.0) ** way}


def _factor(high: float) -> Callable[[Scales, np.random.Generator], Size]:
    def draw(s: Scales, rng: np.random.Generator) -> Size:
        way = rng.choice([-1, 1])
        return lambda x: {"factor": between(x, 1.05, high) ** way}

    return draw


def _dead_time_mismatch(s: Scales, rng: np.random.Generator) -> Size:
    # what the archive's late OP hides of the dead time cannot be taken away
    Td = s.bench.loop.plant.Td - s.bench.late * s.record.Ts
    if Td >= 2 * s.record.Ts and rng.random() < 0.25:
        return lambda x: {"extra": -between(x, 0.1, 1.0) * Td}
    return lambda x: {"extra": between(x, 0.03, 4.0) * s.lag}


def _noise(s: Scales, rng: np.random.Generator) -> Size:
    if rng.random() < 0.2:
        return lambda x: {"factor": between(x, 0.95, 0.05)}
    return lambda x: {"factor": between(x, 1.05, 12.0)}


def _quantisation(s: Scales, rng: np.random.Generator) -> Size:
    at = str(rng.choice(["loop", "record"]))
    return lambda x: {"step": between(x, 0.1 * s.noise, 10 * s.pv), "at": at}


def _compression(s: Scales, rng: np.random.Generator) -> Size:
    return lambda x: {"band": between(x, 0.1 * s.noise, 5 * s.pv)}


def _outliers(s: Scales, rng: np.random.Generator) -> Size:
    at = str(rng.choice(["loop", "record"]))
    rate = float(np.exp(rng.uniform(np.log(0.002), np.log(0.05))))
    return lambda x: {"rate": rate, "size": between(x, 2.5 * s.pv, 40 * s.pv), "at": at}


def _drift(s: Scales, rng: np.random.Generator) -> Size:
    unit = max(s.bench.gain * s.op, s.pv)
    if rng.random() < 0.5:
        way = rng.choice([-1, 1])
        return lambda x: {"rate": way * between(x, 0.2, 60.0) * unit / s.seconds, "walk": 0.0}
    return lambda x: {"rate": 0.0, "walk": between(x, 0.1, 60.0) * unit / np.sqrt(s.seconds)}


def _oscillation(s: Scales, rng: np.random.Generator) -> Size:
    period = s.bench.pace * float(np.exp(rng.uniform(np.log(1.0), np.log(20.0))))
    return lambda x: {"amplitude": min(between(x, 0.05, 10.0) * s.op, 30.0), "period": max(period, 4 * s.record.Ts)}


def _load_steps(s: Scales, rng: np.random.Generator) -> Size:
    rate = float(rng.uniform(4, 25)) / s.seconds
    return lambda x: {"rate": rate, "size": min(between(x, 0.2, 10.0) * s.op, 20.0)}


def _load_drift(s: Scales, rng: np.random.Generator) -> Size:
    if rng.random() < 0.5:
        way = rng.choice([-1, 1])
        return lambda x: {"rate": way * min(between(x, 0.3, 30.0) * s.op, 40.0) / s.seconds, "walk": 0.0}
    return lambda x: {"rate": 0.0, "walk": min(between(x, 0.1, 20.0) * s.op, 20.0) / np.sqrt(s.seconds)}


def _saturation(s: Scales, rng: np.random.Generator) -> Size:
    side = str(rng.choice(["lo", "hi", "both"], p=[0.4, 0.4, 0.2]))

    def size(x: float) -> dict[str, float | str]:
        share = between(x, 0.0005, 0.45)  # of the time in which OP would go further
        low, high = (float(q) for q in np.quantile(s.record.op, [share, 1 - share]))
        high = max(high, low + 0.01)
        return {"lo": low if side != "hi" else 0.0, "hi": high if side != "lo" else 100.0}

    return size


def _detuning(s: Scales, rng: np.random.Generator) -> Size:
    kinds = [(1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1)]
    Kc, Ti = kinds[int(rng.integers(8 if s.bench.loop.controller.type == "PI" else 2))]
    return lambda x: {"Kc_factor": between(x, 1.05, 6.0) ** Kc, "Ti_factor": between(x, 1.1, 8.0) ** Ti}


def _error_deadband(s: Scales, rng: np.random.Generator) -> Size:
    return lambda x: {"width": between(x, 0.2, 20.0) * s.pv}


def _op_quantisation(s: Scales, rng: np.random.Generator) -> Size:
    return lambda x: {"step": min(between(x, 0.1 * s.op_change, 15 * max(s.op_change, 0.3 * s.op)), 20.0)}


_SIZES: dict[str, Callable[[Scales, np.random.Generator], Size]] = {
    "stiction": _stiction,
    "deadband": _deadband,
    "deadzone": _deadzone,
    "valve_lag": _lag,
    "valve_characteristic": _valve_characteristic,
    "gain_mismatch": _factor(6.0),
    "time_constant_mismatch": _factor(8.0),
    "dead_time_mismatch": _dead_time_mismatch,
    "extra_lag": _lag,
    "noise": _noise,
    "quantisation": _quantisation,
    "sensor_lag": _lag,
    "compression": _compression,
    "outliers": _outliers,
    "drift": _drift,
    "oscillation": _oscillation,
    "load_steps": _load_steps,
    "load_drift": _load_drift,
    "saturation": _saturation,
    "detuning": _detuning,
    "error_deadband": _error_deadband,
    "op_quantisation": _op_quantisation,
}
