"""Every effect drawn at random: from x in 0..1 to its parameters, barely to grossly present, in
proportion to the loop it acts in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simbench.detectors.record import LoopRecord

Size = Callable[[float], dict[str, float | str]]
_WAYS = (
    (1, 0),
    (-1, 0),
    (1, 1),
    (-1, 1),
    (1, -1),
    (-1, -1),
    (0, 1),
    (0, -1),
)  # of Kc and Ti; the first two for P


@dataclass(frozen=True, eq=False)
class Yardstick:
    """How large things are in a loop that an effect is drawn for."""

    record: LoopRecord  # of the loop without effect
    noise: float  # standard deviation of the measurement noise (PV units)
    # lag, pace: T + Td of the plant and time scale of the closed loop (s)
    lag: float
    pace: float
    gain: float  # PV units that 1 % brings within the plant's time scale
    Td: float  # dead time (s) that shows in the archive
    integral: bool  # whether the controller has an integral

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
    def seconds(self) -> float:
        """Length of the record (s)."""
        return self.record.duration


Draw = Callable[[Yardstick, np.random.Generator], Size]


def between(x: float, low: float, high: float) -> float:
    """Return low at x = 0, high at x = 1, geometrically in between."""
    return float(low * (high / low) ** x)


def lag(y: Yardstick, rng: np.random.Generator) -> Size:
    """Return the time constant of one more series pole."""
    return lambda x: {"tau": between(x, 0.03, 8.0) * y.lag}


def ratio(high: float) -> Draw:
    """Return a draw of a factor up to `high`, either way."""

    def draw(y: Yardstick, rng: np.random.Generator) -> Size:
        way = rng.choice([-1, 1])
        return lambda x: {"factor": between(x, 1.05, high) ** way}

    return draw


def compression(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw nothing but the band."""
    return lambda x: {"band": between(x, 0.1 * y.noise, 5 * y.pv)}


def dead_time_mismatch(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw whether it is shorter or longer; what the archive's late OP hides of it cannot be taken
    away.
    """
    if y.Td >= 2 * y.record.Ts and rng.random() < 0.25:
        return lambda x: {"extra": -between(x, 0.1, 1.0) * y.Td}
    return lambda x: {"extra": between(x, 0.03, 4.0) * y.lag}


def deadband(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw nothing but the width."""
    return lambda x: {"S": min(between(x, 0.2 * y.op, 30 * y.op), 30.0)}


def deadzone(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw the place."""
    c = float(np.clip(y.record.op.mean() + y.op * rng.normal(), 5, 95))
    return lambda x: {"D": min(between(x, 0.2 * y.op, 15 * y.op), 20.0), "c": c}


def detuning(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw which of Kc and Ti, and which way."""
    Kc, Ti = _WAYS[int(rng.integers(len(_WAYS) if y.integral else 2))]
    return lambda x: {
        "Kc_factor": between(x, 1.05, 6.0) ** Kc,
        "Ti_factor": between(x, 1.1, 8.0) ** Ti,
    }


def drift(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw whether it is a ramp, which way, or a walk."""
    unit = max(y.gain * y.op, y.pv)
    if rng.random() < 0.5:
        way = rng.choice([-1, 1])
        return lambda x: {"rate": way * between(x, 0.2, 60.0) * unit / y.seconds, "walk": 0.0}
    return lambda x: {"rate": 0.0, "walk": between(x, 0.1, 60.0) * unit / np.sqrt(y.seconds)}


def error_deadband(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw nothing but the width."""
    return lambda x: {"width": between(x, 0.2, 20.0) * y.pv}


def load_drift(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw whether it is a ramp, which way, or a walk."""
    if rng.random() < 0.5:
        way = rng.choice([-1, 1])
        return lambda x: {
            "rate": way * min(between(x, 0.3, 30.0) * y.op, 40.0) / y.seconds,
            "walk": 0.0,
        }
    return lambda x: {
        "rate": 0.0,
        "walk": min(between(x, 0.1, 20.0) * y.op, 20.0) / np.sqrt(y.seconds),
    }


def load_steps(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw how many."""
    rate = float(rng.uniform(4, 25)) / y.seconds
    return lambda x: {"rate": rate, "size": min(between(x, 0.2, 10.0) * y.op, 20.0)}


def noise(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw whether there is more or less."""
    if rng.random() < 0.2:
        return lambda x: {"factor": between(x, 0.95, 0.05)}
    return lambda x: {"factor": between(x, 1.05, 12.0)}


def op_quantisation(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw nothing but the step."""
    return lambda x: {
        "step": min(between(x, 0.1 * y.op_change, 15 * max(y.op_change, 0.3 * y.op)), 20.0)
    }


def oscillation(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw the period."""
    period = max(y.pace * float(np.exp(rng.uniform(np.log(1.0), np.log(20.0)))), 4 * y.record.Ts)
    return lambda x: {"amplitude": min(between(x, 0.05, 10.0) * y.op, 30.0), "period": period}


def outliers(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw how many, and where it happens."""
    at = str(rng.choice(["loop", "record"]))
    rate = float(np.exp(rng.uniform(np.log(0.002), np.log(0.05))))
    return lambda x: {"rate": rate, "size": between(x, 2.5 * y.pv, 40 * y.pv), "at": at}


def quantisation(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw where it happens."""
    at = str(rng.choice(["loop", "record"]))
    return lambda x: {"step": between(x, 0.1 * y.noise, 10 * y.pv), "at": at}


def saturation(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw the side; size is the share of the time in which OP would go further."""
    side = str(rng.choice(["lo", "hi", "both"], p=[0.4, 0.4, 0.2]))

    def of(x: float) -> dict[str, float | str]:
        share = between(x, 0.0005, 0.45)
        low, high = (float(q) for q in np.quantile(y.record.op, [share, 1 - share]))
        high = max(high, low + 0.01)
        return {"lo": low if side != "hi" else 0.0, "hi": high if side != "lo" else 100.0}

    return of


def stiction(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw J/S."""
    jump = float(rng.uniform(0.1, 1.0))

    def of(x: float) -> dict[str, float | str]:
        S = min(between(x, 0.2 * y.op, 20 * y.op), 25.0)
        return {"S": S, "J": jump * S}

    return of


def valve_characteristic(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw the way it bends."""
    way = rng.choice([-1, 1])
    return lambda x: {"R": between(x, 1.15, 90.0) ** way}


# each draws all that is not size (direction, place, shape)
DRAWS: dict[str, Draw] = {
    "compression": compression,
    "dead_time_mismatch": dead_time_mismatch,
    "deadband": deadband,
    "deadzone": deadzone,
    "detuning": detuning,
    "drift": drift,
    "error_deadband": error_deadband,
    "extra_lag": lag,
    "gain_mismatch": ratio(6.0),
    "load_drift": load_drift,
    "load_steps": load_steps,
    "noise": noise,
    "op_quantisation": op_quantisation,
    "oscillation": oscillation,
    "outliers": outliers,
    "quantisation": quantisation,
    "saturation": saturation,
    "sensor_lag": lag,
    "stiction": stiction,
    "time_constant_mismatch": ratio(8.0),
    "valve_characteristic": valve_characteristic,
    "valve_lag": lag,
}
