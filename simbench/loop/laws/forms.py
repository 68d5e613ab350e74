"""The forms a law may have: block, numbers with unit and bounds, and what each does to a loop before it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from detectors.errors import ParameterError
from simbench.loop.parameters import Number

if TYPE_CHECKING:
    from simbench.loop.laws import swapped

_Act = Callable[[Any, Any, np.random.Generator], None]


@dataclass(frozen=True)
class Form:
    """A readable family of laws: its block, its numbers (at `identity` it does nothing), its act, and whether OP sees it."""

    block: str
    says: str
    numbers: dict[str, Number]
    act: _Act
    acts: str = "loop"


def spells(n: int, share: float, length: float, rng: np.random.Generator) -> np.ndarray:
    """Return 1.0 in spells of a mean length (samples) that fill a share of n samples, 0.0 between them."""
    out = np.zeros(n)
    if share <= 0.0:
        return out
    share, k, on = min(share, 0.95), 0, rng.random() < share
    while k < n:
        mean = length if on else length * (1.0 - share) / share
        k_next = k + max(round(rng.exponential(max(mean, 1.0))), 1)
        out[k:k_next], k, on = float(on), k_next, not on
    out[0] = 0.0
    return out


def _curve(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.k1 or p.k2 or p.k3:
        # steps are loaded where they act: the forms are words that effects share with simulators of others
        from simbench.loop.laws import curve

        own = {name: getattr(p, name) for name in ("q1", "q2", "q3", "k1", "k2", "k3")}
        setup.add_valve(curve, own | {"centre": setup.op0}, first=True)


def _band(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.S > 0.0 or p.J > 0.0:
        setup.add_valve("choudhury", {"S": p.S, "J": p.J}, first=True)


def _rate(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.slowness > 0.0 or p.tau > 0.0:
        setup.add_valve("lag", {"T": p.tau, **({"rate": 1.0 / p.slowness} if p.slowness > 0.0 else {})})


def _stops(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.low >= p.high:
        raise ParameterError(f"travel stops: low = {p.low:g} must be below high = {p.high:g}")
    if p.low > 0.0 or p.high < 100.0:
        setup.add_valve("limits", {"low": p.low, "high": p.high})


def _linear(setup: Any, num: list[float], den: list[float]) -> None:
    setup.num, setup.den = np.polymul(setup.num, num), np.polymul(setup.den, den)


def _pole(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.tau > 0.0:
        _linear(setup, [1.0], [p.tau, 1.0])


def _zero(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.lead != 0.0 or p.lag > 0.0:
        # a zero needs a pole beside it, or PV would answer at once
        _linear(setup, [p.lead, 1.0], [max(p.lag, 0.1 * abs(p.lead)), 1.0])


def _resonance(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.period > 0.0:
        w = 2.0 * np.pi / p.period
        _linear(setup, [1.0], [1.0 / w**2, 2.0 * p.damping / w, 1.0])


def _size(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.num = setup.num * p.gain
    if setup.den[-1] != 0.0 and p.pace != 1.0:
        setup.den = setup.den * np.append(np.full(setup.den.size - 1, p.pace), 1.0)
    setup.Td = max(setup.Td + p.delay, 0.0)


def _sensor(setup: Any, **own: Any) -> None:
    """Put the sensor's step of the laws in place of the loop's; laws of one loop add up."""
    from simbench.loop.laws import swapped

    before = setup.sensor_law

    def numbers(s: Any) -> swapped.LawSensor:
        follow = 1.0 - np.exp(-s.Ts / s.sensor_tau) if s.sensor_tau > 0 else 1.0
        plain = swapped.LawSensor(float(follow), s.pv_step, -np.inf, np.inf, np.zeros(s.sp.size))
        return (plain if before is None else before(s))._replace(**own)

    setup.sensor_law = numbers


def _controller(setup: Any, **own: Any) -> None:
    """Put the controller's step of the laws in place of the loop's; laws of one loop add up."""
    from simbench.loop.laws import swapped

    before = setup.controller_law

    def numbers(s: Any) -> swapped.LawPI:
        gain = s.sign * s.Kc
        plain = swapped.LawPI(
            gain, gain * s.Ts / s.Ti if s.Ti else 0.0, s.op_lo, s.op_hi, 1.0, 0.0, 0.0, 0.0, s.op0, 0.0, 1.0, np.inf, np.inf,
            0.0, np.append(0.0, np.diff(s.sp)), np.zeros(s.sp.size),
        )  # fmt: skip
        return (plain if before is None else before(s))._replace(**own)

    setup.controller_law = numbers


def _filter(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.tau > 0.0:
        setup.sensor_tau = p.tau


def _held(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.share > 0.0:
        _sensor(setup, idle=spells(setup.sp.size, p.share, p.length / setup.Ts, rng))


def _clipped(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.low > -_FAR or p.high < _FAR:
        _sensor(setup, lo=p.low, hi=p.high)


def _averaged(setup: Any, p: Any, rng: np.random.Generator) -> None:
    width = p.window / setup.Ts
    if width > 1.0:
        setup.recorders.append(lambda pv: running_mean(pv, width))


def running_mean(x: np.ndarray, width: float) -> np.ndarray:
    """Return the mean over the last `width` samples, of which the oldest may count in part; the first value stands before."""
    whole = int(width)
    padded = np.concatenate([np.full(whole, x[0]), x])
    total = np.convolve(padded, np.ones(whole), "full")[whole : whole + x.size]
    oldest = padded[: x.size]
    return (total + (width - whole) * oldest) / width


def _stairs(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.pv_step = max(setup.pv_step, p.step)


def _derivative(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.Td > 0.0:
        _controller(setup, Kd=setup.sign * setup.Kc * p.Td / setup.Ts, follow=1.0 / (1.0 + p.filter / setup.Ts))


def _weight(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.weight != 1.0:
        _controller(setup, ignored=1.0 - p.weight)


def _regime(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.square or p.side or p.schedule or p.gain != 1.0:
        _controller(setup, base=p.gain, square=p.square, side=p.side, schedule=p.schedule, middle=setup.op0)


def _ramps(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.down > 0.0 or p.up > 0.0:
        # s per %, so that none is 0
        down, up = (setup.Ts / x if x > 0.0 else np.inf for x in (p.down, p.up))
        _controller(setup, down=down, up=up)


def _idle(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.share > 0.0:
        _controller(setup, idle=spells(setup.sp.size, p.share, p.length / setup.Ts, rng))


def _limits(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.low >= p.high:
        raise ParameterError(f"limits of OP: low = {p.low:g} must be below high = {p.high:g}")
    setup.op_lo, setup.op_hi = max(setup.op_lo, p.low), min(setup.op_hi, p.high)


def _rest(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.error_gap, setup.op_step = max(setup.error_gap, p.width), max(setup.op_step, p.step)


def _tuning(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.Kc *= p.gain
    if setup.Ti is not None:
        setup.Ti *= p.integral


def _periodic(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.amplitude or p.second:
        t = np.arange(setup.sp.size) * setup.Ts
        w = 2.0 * np.pi / p.period
        first = (p.amplitude + p.growth * (t / (setup.n * setup.Ts) - 0.5)) * np.sin(w * t + rng.uniform(0, 2 * np.pi))
        setup.load_in += setup.hold(first + p.second * np.sin(2 * w * t + rng.uniform(0, 2 * np.pi)))


def _bursts(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.std > 0.0 and p.share > 0.0:
        n, a = setup.sp.size, np.exp(-setup.Ts / p.time)
        white = np.sqrt(1.0 - a * a) * rng.standard_normal(n)
        load = np.empty(n)
        load[0] = white[0]
        for k in range(1, n):
            load[k] = a * load[k - 1] + white[k]
        setup.load_in += setup.hold(p.std * load * spells(n, p.share, p.length / setup.Ts, rng))


def _rough(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.std > 0.0 and p.share > 0.0:
        n = setup.sp.size
        setup.pv_add += p.std * rng.standard_normal(n) * spells(n, p.share, p.length / setup.Ts, rng)


_FAR = 1e9
_SHARE = Number("-", low=0.0, high=0.95, identity=0.0, says="of the time")
_LENGTH = Number("s", low=0.0, positive=True, default=10.0, identity=10.0, says="mean length of a spell")
_SECONDS = Number("s", low=0.0, identity=0.0, says="time constant")
_KNOTS = {f"q{i}": Number("% of travel", low=0.0, high=100.0, identity=25.0 * i, says=f"knot {i}") for i in (1, 2, 3)}
_SLOPES = {f"k{i}": Number("-", low=-1.0, high=5.0, identity=0.0, says=f"change of slope at knot {i}") for i in (1, 2, 3)}
LAW_FORMS: dict[str, Form] = {
    "curve": Form("valve", "MV follows OP along a bent line", {**_KNOTS, **_SLOPES}, _curve),
    "memory": Form("valve", "MV follows OP behind a band, and slips", {
        "S": Number("% of travel", low=0.0, high=100.0, identity=0.0, says="width of the loop of MV over OP"),
        "J": Number("% of travel", low=0.0, high=100.0, identity=0.0, says="slip")}, _band),
    "rate": Form("valve", "MV moves at a limited speed, or behind a lag", {
        "slowness": Number("s/%", low=0.0, identity=0.0, says="time for 1 % of travel"), "tau": _SECONDS}, _rate),
    "stops": Form("valve", "MV stops short of OP", {
        "low": Number("% of travel", low=0.0, high=100.0, identity=0.0, says="lower stop"),
        "high": Number("% of travel", low=0.0, high=100.0, identity=100.0, says="upper stop")}, _stops),
    "size": Form("process", "PV answers MV with another gain, time constant or dead time", {
        "gain": Number("-", low=0.0, positive=True, identity=1.0, says="factor of K"),
        "pace": Number("-", low=0.0, positive=True, identity=1.0, says="factor of T"),
        "delay": Number("s", identity=0.0, says="more dead time")}, _size),
    "pole": Form("process", "one more lag between MV and PV", {"tau": _SECONDS}, _pole),
    "zero": Form("process", "PV first leads, or goes the wrong way", {
        "lead": Number("s", identity=0.0, says="time constant of the zero; below 0: inverse response"),
        "lag": Number("s", low=0.0, identity=0.0, says="time constant of its pole")}, _zero),
    "resonance": Form("process", "PV rings", {
        "period": Number("s", low=0.0, identity=0.0, says="natural period"),
        "damping": Number("-", low=0.01, high=2.0, identity=1.0, says="damping ratio")}, _resonance),
    "filter": Form("sensor", "PV is read through a lag", {"tau": _SECONDS}, _filter),
    "held": Form("sensor", "the reading stands still in spells", {"share": _SHARE, "length": _LENGTH}, _held),
    "clipped": Form("sensor", "the reading stops at ends of its range", {
        "low": Number("PV units", low=-_FAR, high=_FAR, identity=-_FAR, says="lower end"),
        "high": Number("PV units", low=-_FAR, high=_FAR, identity=_FAR, says="upper end")}, _clipped),
    "averaged": Form("sensor", "PV on record is a mean over a window", {
        "window": Number("s", low=0.0, identity=0.0, says="of the mean")}, _averaged, "record"),
    "stairs": Form("sensor", "PV is read in stairs", {
        "step": Number("PV units", low=0.0, identity=0.0, says="of the stairs")}, _stairs),
    "rough": Form("sensor", "the reading is noisier in spells", {
        "std": Number("PV units", low=0.0, identity=0.0, says="of the noise added"),
        "share": _SHARE, "length": _LENGTH}, _rough),
    "derivative": Form("controller", "OP answers PV's speed too", {
        "Td": Number("s", low=0.0, identity=0.0, says="derivative time"),
        "filter": Number("s", low=0.0, identity=0.0, says="of the derivative")}, _derivative),
    "regime": Form("controller", "the gain changes with the error or OP", {
        "gain": Number("-", low=0.0, identity=1.0, says="factor of Kc at no error"),
        "square": Number("1/PV unit", low=-1e6, identity=0.0, says="more of the factor per unit of |error|"),
        "side": Number("-", low=-1.0, high=1.0, identity=0.0, says="relative change of the gain by the error's sign"),
        "schedule": Number("1/%", low=-1.0, high=1.0, identity=0.0, says="relative change of the gain per % of OP")}, _regime),
    "weight": Form("controller", "OP answers the set point otherwise than PV", {
        "weight": Number("-", low=-10.0, high=10.0, identity=1.0, says="of the set point in the gain")}, _weight),
    "ramps": Form("controller", "OP moves at a limited speed", {
        "down": Number("s/%", low=0.0, identity=0.0, says="time for 1 % down"),
        "up": Number("s/%", low=0.0, identity=0.0, says="time for 1 % up")}, _ramps),
    "idle": Form("controller", "the controller does not run in spells", {"share": _SHARE, "length": _LENGTH}, _idle),
    "limits": Form("controller", "OP stops at tighter limits", {
        "low": Number("%", low=0.0, high=100.0, identity=0.0, says="lower limit"),
        "high": Number("%", low=0.0, high=100.0, identity=100.0, says="upper limit")}, _limits),
    "rest": Form("controller", "OP rests while the error is small, or moves in stairs", {
        "width": Number("PV units", low=0.0, identity=0.0, says="of the error in which OP rests"),
        "step": Number("%", low=0.0, identity=0.0, says="of OP's stairs")}, _rest),
    "tuning": Form("controller", "the same law with other numbers", {
        "gain": Number("-", low=0.0, positive=True, identity=1.0, says="factor of Kc"),
        "integral": Number("-", low=0.0, positive=True, identity=1.0, says="factor of Ti")}, _tuning),
    "periodic": Form("disturbance", "a load comes again and again", {
        "period": Number("s", low=0.0, positive=True, identity=100.0, says="of the load"),
        "amplitude": Number("%", low=0.0, high=100.0, identity=0.0, says="at the plant's input"),
        "second": Number("%", low=0.0, high=100.0, identity=0.0, says="amplitude of twice the frequency"),
        "growth": Number("%", low=-100.0, high=100.0, identity=0.0, says="of the amplitude over the record")}, _periodic),
    "bursts": Form("disturbance", "a load that is strong in spells", {
        "std": Number("%", low=0.0, high=100.0, identity=0.0, says="at the plant's input"),
        "time": Number("s", low=0.0, positive=True, identity=10.0, says="its memory"),
        "share": _SHARE, "length": _LENGTH}, _bursts),
}  # fmt: skip


def law_parameters(form: str, **fitted: float) -> dict[str, Number]:
    """Return the numbers of a form, as an effect's PARAMETERS, with the fitted values for defaults."""
    return {name: replace(rule, default=fitted.get(name, rule.identity)) for name, rule in LAW_FORMS[form].numbers.items()}


def apply_law(form: str, setup: Any, p: Any, rng: np.random.Generator) -> None:
    """Do to a setup what a form with its numbers `p` does."""
    LAW_FORMS[form].act(setup, p, rng)
