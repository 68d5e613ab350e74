"""The vocabulary of the gap: five blocks, 22 effects, and the name, unit, bounds and identity of every parameter.

The diagnosis and the blind check's generator share these words and nothing else; what an effect does is written twice.
"""

from __future__ import annotations

from dataclasses import dataclass, field

BLOCKS = ("controller", "valve", "process", "sensor", "disturbance")
NONE, UNKNOWN = "none", "unknown"


@dataclass(frozen=True)
class Quantity:
    """One number of an effect: unit, bounds, the value at which it does nothing, its meaning."""

    unit: str
    low: float
    high: float
    identity: float
    says: str


@dataclass(frozen=True)
class Choice:
    """One word of an effect; the first is the default."""

    words: tuple[str, ...]
    says: str


@dataclass(frozen=True)
class EffectName:
    """An effect's block, its parameters, and its meaning in one line."""

    block: str
    says: str
    parameters: dict[str, Quantity | Choice] = field(default_factory=dict)

    @property
    def identity(self) -> dict[str, float | str]:
        """Parameter values under which the effect changes nothing."""
        return {k: p.words[0] if isinstance(p, Choice) else p.identity for k, p in self.parameters.items()}


_BIG = 1e9  # stands for "no bound": finite, so that optimisers and TOML can carry it

EFFECTS: dict[str, EffectName] = {
    # --- valve: between OP and MV, in % of travel
    "stiction": EffectName(
        "valve",
        "MV sticks, then slips: two-parameter friction",
        {
            "S": Quantity("% of travel", 0.0, 100.0, 0.0, "dead-band plus stick-band: OP travel needed to reverse MV"),
            "J": Quantity("% of travel", 0.0, 100.0, 0.0, "slip-jump"),
        },
    ),
    "deadband": EffectName(
        "valve",
        "backlash: MV follows only after OP has crossed the band",
        {"S": Quantity("% of travel", 0.0, 100.0, 0.0, "width of the band (offset while moving is S/2)")},
    ),
    "deadzone": EffectName(
        "valve",
        "MV rests at c while OP is within D/2 of c, memoryless",
        {
            "D": Quantity("% of travel", 0.0, 100.0, 0.0, "full width of the zone"),
            "c": Quantity("% of travel", 0.0, 100.0, 50.0, "centre; absent = op0 of the operating point"),
        },
    ),
    "valve_lag": EffectName(
        "valve", "first-order lag from OP to MV, after any friction", {"tau": Quantity("s", 0.0, _BIG, 0.0, "time constant")}
    ),
    "valve_characteristic": EffectName(
        "valve",
        "MV = 100 (R^(OP/100) - 1)/(R - 1): equal-percentage R > 1, quick-opening R < 1",
        {"R": Quantity("-", 0.01, 100.0, 1.0, "ratio of the local gains at OP = 100 and OP = 0")},
    ),
    # --- process
    "gain_mismatch": EffectName(
        "process",
        "plant gain differs from the baseline's",
        {"factor": Quantity("-", 0.05, 20.0, 1.0, "K of the plant / K of the baseline")},
    ),
    "time_constant_mismatch": EffectName(
        "process",
        "time constant differs from the baseline's (foptd only)",
        {"factor": Quantity("-", 0.05, 20.0, 1.0, "T of the plant / T of the baseline")},
    ),
    "dead_time_mismatch": EffectName(
        "process",
        "dead time differs from the baseline's",
        {"extra": Quantity("s", -_BIG, _BIG, 0.0, "Td of the plant - Td of the baseline; the sum is cut at 0")},
    ),
    "extra_lag": EffectName(
        "process",
        "a second time constant between plant and PV, before the noise enters",
        {"tau": Quantity("s", 0.0, _BIG, 0.0, "time constant")},
    ),
    # --- sensor
    "noise": EffectName(
        "sensor",
        "white measurement noise, seen by the controller: std^2 = (factor std0)^2 + std^2",
        {
            "factor": Quantity("-", 0.0, 1000.0, 1.0, "times the baseline's noise std; use it where that is above 0"),
            "std": Quantity("PV units", 0.0, _BIG, 0.0, "std added in quadrature; use it where the baseline has no noise"),
        },
    ),
    "quantisation": EffectName(
        "sensor",
        "PV rounded to a lattice through 0",
        {
            "step": Quantity("PV units", 0.0, _BIG, 0.0, "lattice spacing; 0 = none"),
            "at": Choice(("loop", "record"), "loop: the transmitter, the controller sees it; record: the archive only"),
        },
    ),
    "sensor_lag": EffectName(
        "sensor",
        "first-order filter on the noisy PV, before controller and record",
        {"tau": Quantity("s", 0.0, _BIG, 0.0, "time constant")},
    ),
    "compression": EffectName(
        "sensor",
        "archive of PV thinned by a swinging door and rebuilt by straight lines (record only)",
        {"band": Quantity("PV units", 0.0, _BIG, 0.0, "half width of the door: the largest error")},
    ),
    "outliers": EffectName(
        "sensor",
        "isolated one-sample spikes on PV",
        {
            "rate": Quantity("1/sample", 0.0, 0.5, 0.0, "share of samples hit"),
            "size": Quantity("PV units", 0.0, _BIG, 0.0, "mean height; sign at random"),
            "at": Choice(("record", "loop"), "record: the archive only; loop: the controller sees them too"),
        },
    ),
    "drift": EffectName(
        "sensor",
        "slow error of the measurement, seen by the controller",
        {
            "rate": Quantity("PV units/s", -_BIG, _BIG, 0.0, "ramp"),
            "walk": Quantity("PV units/sqrt(s)", 0.0, _BIG, 0.0, "random walk beside it"),
        },
    ),
    # --- disturbance: loads at the plant's input, in % of MV
    "oscillation": EffectName(
        "disturbance",
        "sinusoidal load at the plant's input",
        {"amplitude": Quantity("%", 0.0, 100.0, 0.0, "half peak-to-peak"), "period": Quantity("s", 0.0, _BIG, 100.0, "period")},
    ),
    "load_steps": EffectName(
        "disturbance",
        "load at the plant's input that jumps to a new level at random times",
        {
            "rate": Quantity("1/s", 0.0, _BIG, 0.0, "mean number of jumps per second"),
            "size": Quantity("%", 0.0, 100.0, 0.0, "std of the levels about the mean load"),
        },
    ),
    "load_drift": EffectName(
        "disturbance",
        "slowly moving load at the plant's input",
        {
            "rate": Quantity("%/s", -_BIG, _BIG, 0.0, "ramp"),
            "walk": Quantity("%/sqrt(s)", 0.0, _BIG, 0.0, "random walk beside it"),
        },
    ),
    # --- controller: between PV and OP
    "saturation": EffectName(
        "controller",
        "OP limited more tightly than 0..100, with anti-windup",
        {"lo": Quantity("%", 0.0, 100.0, 0.0, "lower limit"), "hi": Quantity("%", 0.0, 100.0, 100.0, "upper limit")},
    ),
    "detuning": EffectName(
        "controller",
        "tuning in the plant's controller differs from the baseline's",
        {
            "Kc_factor": Quantity("-", 0.02, 50.0, 1.0, "Kc of the plant / Kc of the baseline"),
            "Ti_factor": Quantity("-", 0.02, 50.0, 1.0, "Ti of the plant / Ti of the baseline (PI only)"),
        },
    ),
    "error_deadband": EffectName(
        "controller",
        "error counts as 0 while |SP - PV| <= width/2, unchanged outside",
        {"width": Quantity("PV units", 0.0, _BIG, 0.0, "full width")},
    ),
    "op_quantisation": EffectName(
        "controller",
        "OP rounded to a lattice through 0 on its way to the valve and the record",
        {"step": Quantity("%", 0.0, 100.0, 0.0, "lattice spacing; 0 = none")},
    ),
}


def block_of(effect: str) -> str:
    """Return the block of an effect id; `none` and `unknown` stand for themselves.

    Parameters
    ----------
    effect : str
        An effect id, "none" or "unknown".

    Returns
    -------
    str

    Raises
    ------
    KeyError
        For any other word.

    Examples
    --------
    >>> block_of("stiction"), block_of("none")
    ('valve', 'none')
    """
    return effect if effect in (NONE, UNKNOWN) else EFFECTS[effect].block
