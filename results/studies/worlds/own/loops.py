"""Describe one loop completely, prepare it for simulation, and produce what its archive stores;
loads and noise in several spectra.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from results.studies.withheld.distance import Scale, Signals
from results.studies.withheld.world import TestPlan
from results.studies.worlds.own import simulator as sim


@dataclass(frozen=True)
class TrueLoop:
    """One loop as it really is; plain numbers, so that it can be sealed as JSON and simulated
    again.

    Times in s, OP and load in %, PV in `unit` PV units per %.
    """

    plant: str
    K: float
    T: float
    Td: float
    controller: str
    Kc: float
    Ti: float
    sign: float
    op0: float
    pv0: float
    Ts: float
    n: int
    steps: tuple[tuple[float, float], ...]
    noise_std: float
    noise_colour: str
    load_std: float
    load_colour: str
    load_tau: float
    unit: float
    speed: float  # s; closed-loop time scale
    play: float
    form: int
    integral: int
    log_is_late: bool
    friction: int
    smooth_gap: bool
    mv: bool
    mv_noise: float
    # K, T, and Td as it appears between logged OP and logged PV
    nominal: tuple[float, float, float]

    @property
    def warm_up(self) -> int:
        """Samples simulated and thrown away, so that the record starts in the middle of the loop's
        life.
        """
        return int(min(max(10 * (self.speed + self.Ti) / self.Ts, 200), 900))

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.n * self.Ts

    @property
    def sp_moves(self) -> bool:
        """Whether the set point steps within the record."""
        return bool(self.steps)

    @property
    def scale(self) -> Scale:
        """What records of this loop are measured in."""
        step_unit = self.K if self.plant == "foptd" else 1.0 / self.Kc
        return Scale(self.Ts, self.speed, self.unit, self.noise_std, step_unit, self.sp_moves)

    def to_dict(self) -> dict:
        """Return the fields as JSON types."""
        return asdict(self)

    @classmethod
    def from_dict(cls, table: dict) -> TrueLoop:
        """Build the case from what `to_dict` wrote."""
        table = dict(table)
        table["steps"] = tuple(tuple(s) for s in table["steps"])
        table["nominal"] = tuple(table["nominal"])
        return cls(**table)

    def as_nominal(self) -> TrueLoop:
        """Return the loop with the baseline's plant in place of the true one."""
        K, T, Td = self.nominal
        return replace(self, K=K, T=T, Td=Td + self.Ts * self.log_is_late)


@dataclass
class Prepared:
    """One run before it starts: numbers of the physics and arrays over warm-up and record, which
    faults may change.
    """

    case: TrueLoop
    physics: dict[str, float]
    sp: np.ndarray
    noise: np.ndarray
    load: np.ndarray
    sensor: np.ndarray
    skip: np.ndarray
    hold: np.ndarray
    asleep: np.ndarray
    op_add: np.ndarray
    valve_add: np.ndarray
    gain: np.ndarray
    hand: np.ndarray
    archive: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)

    @property
    def start(self) -> int:
        """Index of the record's first sample."""
        return self.case.warm_up

    @property
    def size(self) -> int:
        """Samples of warm-up and record together."""
        return self.sp.size


Fault = Callable[[Prepared, np.random.Generator], None]
_NOISE, _LOAD, _FAULT, _LOG = range(4)
_NOTHING = ("sensor", "skip", "hold", "asleep", "op_add", "valve_add")  # where nothing is wrong


def _stream(seed: int, purpose: int) -> np.random.Generator:
    """Return a random stream per purpose, so that a fault's strength does not shift anybody
    else's numbers.
    """
    return np.random.default_rng([seed, purpose])


def prepare(case: TrueLoop, seed: int) -> Prepared:
    """Return the run of `case` without any fault."""
    n = case.warm_up + case.n
    sp = np.full(n, case.pv0)
    for t, value in case.steps:
        sp[case.warm_up + round(t / case.Ts) :] = value
    # wakes a valve that would rest for ever
    sp[: case.warm_up // 4] += 3.0 * case.unit * case.sign * np.sign(case.K)
    same = {
        key: float(getattr(case, key))
        for key in [
            "K",
            "T",
            "Td",
            "sign",
            "Kc",
            "Ti",
            "op0",
            "form",
            "integral",
            "play",
            "pv0",
            "Ts",
        ]
    }
    physics = same | {"integrating": float(case.plant == "integrating"), "bias": case.op0}
    return Prepared(
        case=case,
        physics=physics,
        sp=sp,
        noise=case.noise_std * coloured(case.noise_colour, n, 2.0, _stream(seed, _NOISE)),
        load=case.load_std
        * coloured(case.load_colour, n, case.load_tau / case.Ts, _stream(seed, _LOAD)),
        **{name: np.zeros(n) for name in _NOTHING},
        gain=np.ones(n),
        hand=np.full(n, np.nan),
    )


def _faulty(case: TrueLoop, seed: int, faults: tuple[Fault, ...]) -> Prepared:
    setup = prepare(case, seed)
    for i, fault in enumerate(faults):
        fault(setup, _stream(seed, _FAULT + 10 * i))
    return setup


def simulate(case: TrueLoop, seed: int, faults: tuple[Fault, ...] = ()) -> Signals:
    """Run one loop and return what its historian would show."""
    return shown(_faulty(case, seed, faults), seed)[0]


def test(
    case: TrueLoop, seed: int, faults: tuple[Fault, ...], plan: TestPlan
) -> tuple[Signals, np.ndarray]:
    """Run a test of the menu on the loop; return what is logged of it, and PV as it truly is."""
    r = plan.faster
    if r > 1:
        case = replace(case, Ts=case.Ts / r, Ti=case.Ti / r)
    setup = _faulty(replace(case, n=plan.n, steps=()), seed, faults)
    setup.physics["Kc"] *= plan.Kc_ratio
    setup.sp[setup.start :] += plan.sp
    setup.hand[setup.start :] = plan.op
    if r > 1:
        setup.physics["speed"] = setup.physics.get("speed", sim.Physics().speed) / r
        # the controller keeps its period
        setup.skip = np.maximum(setup.skip, (np.arange(setup.size) - setup.start) % r != 0)
    if plan.raw:
        setup.archive.clear()
    return shown(setup, seed, late=case.log_is_late and not plan.raw)


def shown(setup: Prepared, seed: int, late: bool | None = None) -> tuple[Signals, np.ndarray]:
    """Run what was prepared; return what the historian shows and PV as it truly is, over the
    record.
    """
    case, n = setup.case, setup.size
    op, pv, true, mv = (np.empty(n) for _ in range(4))
    inputs = sim.Inputs(*(getattr(setup, name) for name in sim.Inputs._fields))
    sim.run(sim.Physics(**setup.physics), inputs, op, pv, true, mv)
    mv += case.mv_noise * _stream(seed, _LOG).standard_normal(n)
    shift = int(case.log_is_late if late is None else late)
    rows = slice(setup.start, n)
    # the scan logs OP before the controller has computed the new one
    before = slice(setup.start - shift, n - shift)
    archived = pv[rows].copy()
    for record in setup.archive:
        archived = record(archived)
    return Signals(
        sp=setup.sp[rows].copy(), op=op[before].copy(), pv=archived, mv=mv[before].copy()
    ), true[rows]


def coloured(colour: str, n: int, tau: float, rng: np.random.Generator) -> np.ndarray:
    """Return stationary noise of unit variance."""
    white = rng.standard_normal(n + 500)
    if colour == "none":
        return np.zeros(n)
    if colour == "white":
        return white[:n]
    if colour == "pink":
        f = np.fft.rfftfreq(n + 500)
        shape = 1.0 / np.sqrt(np.maximum(f, 0.05 / tau))
        shape[0] = 0.0
        x = np.fft.irfft(np.fft.rfft(white) * shape, n + 500)[:n]
        return x / math.sqrt(np.mean(shape**2))
    if colour == "ar2":
        radius, angle = math.exp(-1.0 / tau), 1.0 / tau  # damping 0.7
        a1, a2 = -2.0 * radius * math.cos(angle), radius**2
        variance = (1.0 + a2) / ((1.0 - a2) * ((1.0 + a2) ** 2 - a1**2))
        return np.asarray(lfilter([1.0], [1.0, a1, a2], white))[500:] / math.sqrt(variance)
    if colour == "flicker":
        return math.sqrt(0.8) * white[:n] + math.sqrt(0.2) * coloured("pink", n, tau, rng)
    if colour == "bluish":
        return (white[1 : n + 1] - 0.2 * white[:n]) / math.sqrt(1.04)
    if colour == "heavy":
        return rng.standard_t(8, n) / math.sqrt(8 / 6)
    phi = math.exp(-1.0 / tau)
    return np.asarray(lfilter([math.sqrt(1.0 - phi**2)], [1.0, -phi], white))[500:]
