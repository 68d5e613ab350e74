"""A random healthy loop: plant, tuning, set point, load and noise of any colour, and how its signals are archived."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.closed_loop.summary_features import Features, features
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.setup import Setup

LOADS = {"none": 0.1, "first order": 0.25, "smooth": 0.2, "resonant": 0.15, "1/f": 0.15, "slow and white": 0.15}
NOISES = {"white": 0.55, "moving average": 0.15, "heavy tails": 0.15, "white and 1/f": 0.15}
FORMS = {"backward": 0.0, "trapezoid": 0.5, "forward": 1.0}  # samples by which the integral acts later than backward Euler


@dataclass(frozen=True, eq=False)
class Bench:
    """A loop without effect and everything its author would not know of it.

    `loop` holds plant, nominal tuning, valve and noise std and runs over warm-up and record; `sp` is its set point in PV
    units, (warm + n,). `scale` is the plant's time scale in s (T, or what stands for it on an integrating plant), `gain`
    the PV units that 1 % brings within it, `pace` the closed loop's time in s. `colour` and `load_std` (%) make the load,
    `noise` the kind of the noise with its parameter; `late` archives OP and MV one sample late, with `digits` digits.
    """

    loop: Loop
    warm: int
    sp: np.ndarray
    steps: tuple[tuple[float, float], ...]
    scale: float
    gain: float
    pace: float
    colour: np.ndarray
    load_std: float
    noise: tuple[str, float]
    form: float
    late: bool
    digits: int
    kick: float

    @property
    def n(self) -> int:
        """Samples of the record."""
        return self.sp.size - self.warm

    def setup(self, seed: tuple[int, ...]) -> Setup:
        """Return the loop with this seed's load but without noise, open to effects; `finish` completes it."""
        setup = resolve_loop(self.loop.with_("noise.std", 0.0), 0)
        setup.noise_std = self.loop.noise.std
        setup.sp[:] = self.sp
        setup.load_in += self.load_std * shaped(np.random.default_rng([*seed, 1]), self.sp.size, self.colour)
        return setup

    def finish(self, setup: Setup, seed: tuple[int, ...]) -> Setup:
        """Add the noise, execute the PI as this controller does, and bring the valve's stages into one order."""
        setup.pv_add += setup.noise_std * noise(np.random.default_rng([*seed, 2]), self.sp.size, *self.noise)
        if setup.Ti is not None:
            # trapezoid and forward forms are backward Euler with both parameters smaller by the same share
            less = 1.0 - self.form * setup.Ts / setup.Ti
            setup.Kc, setup.Ti = setup.Kc * less, setup.Ti * less
        _one_chain(setup)
        return setup

    def run(self, setup: Setup) -> LoopRecord:
        """Simulate a finished setup and return what the archive shows of it after the warm-up, MV included."""
        record = run_setup(setup, kick=self.kick).record
        assert record.mv is not None
        return self.archive(record.op, record.pv, record.mv)

    def archive(self, op: np.ndarray, pv: np.ndarray, mv: np.ndarray) -> LoopRecord:
        """Cut off the warm-up, shift OP and MV where the archive is late, and round as a CSV is written."""
        now, then = slice(self.warm, None), slice(self.warm - self.late, self.sp.size - self.late)
        return LoopRecord(
            op=written(op[then], self.digits),
            pv=written(pv[now], self.digits),
            sp=written(self.sp[now], self.digits),
            mv=mv[then],
            Ts=self.loop.sampling.Ts,
            process="integrating" if self.loop.plant.T is None else "self-regulating",
            op_span=(0.0, 100.0),
        )

    def baseline(self, rng: np.random.Generator) -> Loop:
        """Return what the loop's author believes: K, T, Td within 10 %, exact tuning, noise std and valve, no load."""
        table = self.loop.to_table()
        Ts = self.loop.sampling.Ts
        off = rng.uniform(0.9, 1.1, 3)
        table["plant"]["K"] *= off[0]
        table["plant"]["Td"] = (table["plant"]["Td"] - self.late * Ts) * off[1]
        if self.loop.plant.T is not None:
            table["plant"]["T"] *= off[2]
        table["sampling"]["n"] = self.n
        table["setpoint"] = {"value": float(self.sp[self.warm]), "steps": [list(s) for s in self.steps]}
        return Loop.from_table(table)


def draw_bench(rng: np.random.Generator, foptd: bool = False, steps: bool = False, play: bool = True) -> Bench:
    """Draw a loop.

    Parameters
    ----------
    rng : numpy.random.Generator
    foptd : bool
        No integrating plant.
    steps : bool
        The set point must move.
    play : bool
        The healthy valve may have some.

    Returns
    -------
    Bench
    """
    log = lambda low, high: float(np.exp(rng.uniform(np.log(low), np.log(high))))  # noqa: E731
    integrating = not foptd and rng.random() < 0.4
    Ts = float(rng.choice([0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0]))
    T = Ts * log(4.0, 60.0)
    Td = T * log(0.08, 1.2)
    gain = log(0.03, 30.0)
    sign = float(rng.choice([-1.0, 1.0]))
    slow = log(0.4, 2.0) * max(T, Td)  # the closed loop's wanted time constant
    P = rng.random() < 0.15
    if integrating:
        K = gain / T
        Kc = (1.0 / (slow + Td) if P else (2 * slow + Td) / (slow + Td) ** 2) / K
        Ti = (2 * slow + Td) * float(rng.uniform(0.7, 1.3))
        pace = slow + Td
    else:
        K, Kc, Ti, pace = gain, T / (gain * (slow + Td)), T * float(rng.uniform(0.7, 1.3)), T + Td
    load_std = log(0.2, 3.0)
    noise_std = gain * load_std * log(0.02, 0.5)
    n = int(log(800, 4000))
    warm = int(np.clip(6 * (T + Td + slow) / Ts, 200, 2500))
    value = float(f"{gain * 100 * rng.uniform(0.1, 2.0):.4g}")
    moves = []
    if steps or rng.random() > 0.45:
        reach = gain * load_std * log(1.0, 6.0)
        for t in np.sort(rng.integers(n // 50, n - n // 50, int(rng.integers(2, 11)))):
            moves.append((float(t * Ts), float(f"{value + reach * rng.uniform(-1, 1):.6g}")))
    sp = np.full(warm + n, value)
    sp[: warm // 4] += sign * gain * float(rng.uniform(1.0, 4.0))  # a bump long ago, so that sticky loops cycle
    for t, level in moves:
        sp[warm + round(t / Ts) :] = level
    valve: dict = {"model": "deadband", "S": float(rng.uniform(0.2, 1.0))}
    if not (rng.random() < 0.12 and play):
        valve = {"model": "ideal"}
    plant = {"K": sign * K, "Td": Td}
    loop = Loop.from_table({
        "plant": {"type": "integrating", **plant} if integrating else {"type": "foptd", **plant, "T": T},
        "controller": {
            **({"type": "P"} if P else {"type": "PI", "Ti": Ti}),
            "Kc": Kc,
            "direction": "reverse" if sign > 0 else "direct",
        },
        "operating_point": {"op0": float(f"{rng.uniform(25, 75):.3g}"), "pv0": value},
        "valve": valve,
        "sampling": {"Ts": Ts, "n": warm + n},
        "noise": {"std": noise_std},
        "setpoint": {"value": value},
    })  # fmt: skip
    kind = _pick(rng, LOADS)
    frequency = np.fft.rfftfreq(next_fast_len(2 * sp.size, real=True))
    noise_kind = _pick(rng, NOISES)
    depth = {"moving average": rng.uniform(0.15, 0.6) * rng.choice([-1, 1]), "heavy tails": rng.uniform(5, 10)}
    return Bench(
        loop=loop,
        warm=warm,
        sp=sp,
        steps=tuple(moves),
        scale=T,
        gain=gain,
        pace=pace,
        colour=_colour(kind, frequency, pace / Ts * log(0.3, 5.0), rng),
        load_std=load_std,
        noise=(noise_kind, float(depth.get(noise_kind, rng.uniform(0.2, 0.6)))),
        form=float(rng.choice(list(FORMS.values()))),
        late=bool(Td >= 2 * Ts and rng.random() < 0.25),
        digits=int(rng.integers(6, 9)),
        kick=float(rng.uniform(2.0, 6.0) * rng.choice([-1, 1])),
    )


def shaped(rng: np.random.Generator, n: int, amplitude: np.ndarray) -> np.ndarray:
    """Return n samples of stationary Gaussian noise of unit std (0 where the amplitudes are) with this spectrum.

    Parameters
    ----------
    rng : numpy.random.Generator
    n : int
    amplitude : ndarray, shape (m // 2 + 1,)
        Of the real Fourier transform of m >= 2 n samples; the mean is left out.

    Returns
    -------
    ndarray, shape (n,)
    """
    size = 2.0 * float(np.sqrt(np.sum(amplitude[1:] ** 2)))
    if size == 0.0:
        return np.zeros(n)
    z = (rng.standard_normal(amplitude.size) + 1j * rng.standard_normal(amplitude.size)) * amplitude
    z[0] = 0.0
    m = 2 * (amplitude.size - 1)
    return np.fft.irfft(z, m)[:n] * (m / size)


def noise(rng: np.random.Generator, n: int, kind: str, depth: float) -> np.ndarray:
    """Return n samples of measurement noise of unit std; `depth` is the kind's own number (coefficient, degrees, share)."""
    if kind == "heavy tails":
        return rng.standard_t(depth, n) * np.sqrt((depth - 2) / depth)
    white = rng.standard_normal(n + 1)
    if kind == "moving average":
        return (white[1:] + depth * white[:-1]) / np.hypot(1.0, depth)
    if kind == "white and 1/f":
        f = np.fft.rfftfreq(next_fast_len(2 * n, real=True))
        return np.sqrt(1 - depth**2) * white[1:] + depth * shaped(rng, n, 1.0 / np.sqrt(np.maximum(f, 1e-3)))
    return white[1:]


def written(x: np.ndarray, digits: int) -> np.ndarray:
    """Return a column rounded to the decimals that give its largest value so many significant digits."""
    return np.round(x, digits - 1 - int(np.floor(np.log10(max(float(np.abs(x).max()), 1e-12)))))


def look(record: LoopRecord) -> Features:
    """Return the features of the whole record."""
    assert record.sp is not None
    return features(record.op, record.pv, record.sp)


def _colour(kind: str, f: np.ndarray, tau: float, rng: np.random.Generator) -> np.ndarray:
    # tau: correlation time in samples; f in cycles per sample
    w = 2 * np.pi * f * tau
    lag = 1.0 / np.sqrt(1.0 + w**2)
    if kind == "none":
        return np.zeros(f.size)
    if kind == "smooth":
        return lag**2
    if kind == "resonant":
        return 1.0 / np.sqrt((1 - w**2) ** 2 + (2 * rng.uniform(0.15, 0.5) * w) ** 2)
    if kind == "1/f":
        top = w * 10.0 ** -rng.uniform(1.0, 3.0)
        return 1.0 / np.sqrt(np.maximum(w, 1.0)) / np.sqrt(1.0 + top**2)
    if kind == "slow and white":
        share = rng.uniform(0.3, 0.8)
        return np.hypot(share * lag / np.sqrt(np.mean(lag**2)), np.sqrt(1 - share**2))
    return lag


def _pick(rng: np.random.Generator, shares: dict[str, float]) -> str:
    return str(rng.choice(list(shares), p=list(shares.values())))


def _one_chain(setup: Setup) -> None:
    # one order of stages, one form of controller and sensor: a handful of kernels to compile instead of hundreds
    stages = {module.__name__.rpartition(".")[2]: (module, p) for module, p in setup.valves}
    rest = {"deadzone": {"D": 0.0, "c": 50.0}, "deadband": {"S": 0.0}, "gain_ratio": {"R": 1.0}, "lag": {"T": 0.0}}
    play = sum(p.S for module, p in setup.valves if module.__name__.endswith(".deadband"))  # plays in series add up
    chain = []
    for name, idle in rest.items():
        own = stages.get(name)
        if name == "deadband":
            rest_of = [s for k, s in stages.items() if k not in (*rest, "ideal")]
            own, idle = (rest_of[0] if rest_of else None), {"S": play}
        module = VALVES.load(name)
        chain.append(own or (module, valve_parameters(module, idle, setup.Ts)))
    setup.valves = chain
    setup.sensor_tau = max(setup.sensor_tau, 1e-6 * setup.Ts)
    setup.error_gap = max(setup.error_gap, 1e-300)
