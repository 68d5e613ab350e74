"""The forms a law may have: block, numbers with unit and bounds, and what each does to a loop
before it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import Number


@dataclass(frozen=True)
class Form:
    """A readable family of laws: its block, its numbers (all at `identity`: it is not there), and
    its act on a setup.

    Parameters
    ----------
    block : str
        Block of the loop in which it acts.
    says : str
        Its meaning in one line.
    numbers : dict of str to Number
        Its numbers with units and bounds.
    act : callable
        Changes a setup by the numbers, and random numbers, before the loop runs.
    """

    block: str
    says: str
    numbers: dict[str, Number]
    act: Callable[[Any, Any, np.random.Generator], None]


def spells(setup: Any, p: Any, rng: np.random.Generator) -> np.ndarray:
    """Return 1.0 in spells of a mean length `p.length` (s) that fill a share of the run, 0.0
    between them.
    """
    out, length = np.zeros(setup.sp.size), p.length / setup.Ts
    if p.share <= 0.0:
        return out
    k, on = 0, rng.random() < p.share
    while k < out.size:
        mean = length if on else length * (1.0 - p.share) / p.share
        k_next = k + max(round(rng.exponential(max(mean, 1.0))), 1)
        out[k:k_next], k, on = float(on), k_next, not on
    out[0] = 0.0
    return out


def _curve(setup: Any, p: Any, rng: np.random.Generator) -> None:
    # steps are loaded where they act: the forms are words that effects share with simulators of
    # others
    from simbench.loop.laws import curve

    setup.add_valve(curve, p._asdict() | {"centre": setup.op0}, first=True)


def _rate(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.add_valve("lag", {"T": p.tau, **({"rate": 1.0 / p.slowness} if p.slowness > 0.0 else {})})


def _limits(setup: Any, p: Any, rng: np.random.Generator) -> None:
    if p.low >= p.high:
        raise ParameterError(f"limits of OP: low = {p.low:g} must be below high = {p.high:g}")
    setup.op_lo, setup.op_hi = max(setup.op_lo, p.low), min(setup.op_hi, p.high)


def _linear(setup: Any, num: list[float], den: list[float]) -> None:
    setup.num, setup.den = np.polymul(setup.num, num), np.polymul(setup.den, den)


def _zero(setup: Any, p: Any, rng: np.random.Generator) -> None:
    # a zero needs a pole beside it, or PV would answer at once
    _linear(setup, [p.lead, 1.0], [max(p.lag, 0.1 * abs(p.lead)), 1.0])


def _size(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.num = setup.num * p.gain
    if setup.den[-1] != 0.0 and p.pace != 1.0:
        setup.den = setup.den * np.append(np.full(setup.den.size - 1, p.pace), 1.0)
    setup.Td = max(setup.Td + p.delay, 0.0)


def _stairs(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.pv_step = max(setup.pv_step, p.step)


def _rest(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.error_gap, setup.op_step = max(setup.error_gap, p.width), max(setup.op_step, p.step)


def _tuning(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.Kc *= p.gain
    if setup.Ti is not None:
        setup.Ti *= p.integral


def _controller(setup: Any, **own: Any) -> None:
    """Put the controller's step of the laws in place of the loop's; laws of one loop add up."""
    before = setup.controller_law or _plain_pi
    setup.controller_law = lambda s: before(s)._replace(**own)


def _plain_pi(s: Any) -> Any:
    from simbench.loop.laws.swapped import LawPI

    gain, moves = s.sign * s.Kc, np.append(0.0, np.diff(s.sp))
    return LawPI(
        Kc=gain,
        Ki=gain * s.Ts / s.Ti if s.Ti else 0.0,
        lo=s.op_lo,
        hi=s.op_hi,
        base=1.0,
        square=0.0,
        side=0.0,
        schedule=0.0,
        middle=s.op0,
        Kd=0.0,
        follow=1.0,
        down=np.inf,
        up=np.inf,
        ignored=0.0,
        moves=moves,
        idle=np.zeros(s.sp.size),
    )


def _sensor(setup: Any, **own: Any) -> None:
    """Put the sensor's step of the laws in place of the loop's; laws of one loop add up."""
    before = setup.sensor_law or _plain_sensor
    setup.sensor_law = lambda s: before(s)._replace(**own)


def _plain_sensor(s: Any) -> Any:
    from simbench.loop.laws.swapped import LawSensor

    follow = 1.0 - np.exp(-s.Ts / s.sensor_tau) if s.sensor_tau > 0 else 1.0
    return LawSensor(float(follow), s.pv_step, -np.inf, np.inf, np.zeros(s.sp.size))


def _ramps(setup: Any, p: Any, rng: np.random.Generator) -> None:
    # s per %, so that none is 0
    down, up = (setup.Ts / x if x > 0.0 else np.inf for x in (p.down, p.up))
    _controller(setup, down=down, up=up)


def _bursts(setup: Any, p: Any, rng: np.random.Generator) -> None:
    from simbench.detectors.signal.filters import lfilter

    a = np.exp(-setup.Ts / p.time)
    load = lfilter([np.sqrt(1.0 - a * a)], [1.0, -a], rng.standard_normal(setup.sp.size))
    setup.load_in += setup.hold(p.std * load * spells(setup, p, rng))


def _rough(setup: Any, p: Any, rng: np.random.Generator) -> None:
    setup.pv_add += p.std * rng.standard_normal(setup.sp.size) * spells(setup, p, rng)


_FAR = 1e9
_SPELLS = {
    "share": Number("-", low=0.0, high=0.95, identity=0.0, says="of the time"),
    "length": Number(
        "s", low=0.0, positive=True, default=10.0, identity=10.0, says="mean length of a spell"
    ),
}
_SECONDS = Number("s", low=0.0, identity=0.0, says="time constant")
_KNOTS = {
    f"q{i}": Number("% of travel", low=0.0, high=100.0, identity=25.0 * i, says=f"knot {i}")
    for i in (1, 2, 3)
}
_SLOPES = {
    f"k{i}": Number("-", low=-1.0, high=5.0, identity=0.0, says=f"change of slope at knot {i}")
    for i in (1, 2, 3)
}
LAW_FORMS: dict[str, Form] = {
    "curve": Form("valve", "MV follows OP along a bent line", {**_KNOTS, **_SLOPES}, _curve),
    "memory": Form(
        "valve",
        "MV follows OP behind a band, and slips",
        {
            "S": Number(
                "% of travel",
                low=0.0,
                high=100.0,
                identity=0.0,
                says="width of the loop of MV over OP",
            ),
            "J": Number("% of travel", low=0.0, high=100.0, identity=0.0, says="slip"),
        },
        lambda s, p, rng: s.add_valve("choudhury", {"S": p.S, "J": p.J}, first=True),
    ),
    "rate": Form(
        "valve",
        "MV moves at a limited speed, or behind a lag",
        {
            "slowness": Number("s/%", low=0.0, identity=0.0, says="time for 1 % of travel"),
            "tau": _SECONDS,
        },
        _rate,
    ),
    "size": Form(
        "process",
        "PV answers MV with another gain, time constant or dead time",
        {
            "gain": Number("-", low=0.0, positive=True, identity=1.0, says="factor of K"),
            "pace": Number("-", low=0.0, positive=True, identity=1.0, says="factor of T"),
            "delay": Number("s", identity=0.0, says="more dead time"),
        },
        _size,
    ),
    "zero": Form(
        "process",
        "PV leads or lags, or goes the wrong way first",
        {
            "lead": Number(
                "s", identity=0.0, says="time constant of the zero; below 0: inverse response"
            ),
            "lag": Number("s", low=0.0, identity=0.0, says="time constant of its pole"),
        },
        _zero,
    ),
    "held": Form(
        "sensor",
        "the reading stands still in spells",
        _SPELLS,
        lambda s, p, rng: _sensor(s, idle=spells(s, p, rng)),
    ),
    "clipped": Form(
        "sensor",
        "the reading stops at ends of its range",
        {
            "low": Number("PV units", low=-_FAR, high=_FAR, identity=-_FAR, says="lower end"),
            "high": Number("PV units", low=-_FAR, high=_FAR, identity=_FAR, says="upper end"),
        },
        lambda s, p, rng: _sensor(s, lo=p.low, hi=p.high),
    ),
    "stairs": Form(
        "sensor",
        "PV is read in stairs",
        {"step": Number("PV units", low=0.0, identity=0.0, says="of the stairs")},
        _stairs,
    ),
    "rough": Form(
        "sensor",
        "the reading is noisier in spells",
        {"std": Number("PV units", low=0.0, identity=0.0, says="of the noise added"), **_SPELLS},
        _rough,
    ),
    "derivative": Form(
        "controller",
        "OP answers PV's speed too",
        {
            "Td": Number("s", low=0.0, identity=0.0, says="derivative time"),
            "filter": Number("s", low=0.0, identity=0.0, says="of the derivative"),
        },
        lambda s, p, rng: _controller(
            s, Kd=s.sign * s.Kc * p.Td / s.Ts, follow=1.0 / (1.0 + p.filter / s.Ts)
        ),
    ),
    "regime": Form(
        "controller",
        "the gain changes with the error or OP",
        {
            "gain": Number("-", low=0.0, identity=1.0, says="factor of Kc at no error"),
            "square": Number(
                "1/PV unit", low=-1e6, identity=0.0, says="more of the factor per unit of |error|"
            ),
            "side": Number(
                "-",
                low=-1.0,
                high=1.0,
                identity=0.0,
                says="relative change of the gain by the error's sign",
            ),
            "schedule": Number(
                "1/%",
                low=-1.0,
                high=1.0,
                identity=0.0,
                says="relative change of the gain per % of OP",
            ),
        },
        lambda s, p, rng: _controller(
            s, base=p.gain, square=p.square, side=p.side, schedule=p.schedule
        ),
    ),
    "weight": Form(
        "controller",
        "OP answers the set point otherwise than PV",
        {
            "weight": Number(
                "-", low=-10.0, high=10.0, identity=1.0, says="of the set point in the gain"
            )
        },
        lambda s, p, rng: _controller(s, ignored=1.0 - p.weight),
    ),
    "ramps": Form(
        "controller",
        "OP moves at a limited speed",
        {
            "down": Number("s/%", low=0.0, identity=0.0, says="time for 1 % down"),
            "up": Number("s/%", low=0.0, identity=0.0, says="time for 1 % up"),
        },
        _ramps,
    ),
    "idle": Form(
        "controller",
        "the controller does not run in spells",
        _SPELLS,
        lambda s, p, rng: _controller(s, idle=spells(s, p, rng)),
    ),
    "limits": Form(
        "controller",
        "OP stops at tighter limits",
        {
            "low": Number("%", low=0.0, high=100.0, identity=0.0, says="lower limit"),
            "high": Number("%", low=0.0, high=100.0, identity=100.0, says="upper limit"),
        },
        _limits,
    ),
    "rest": Form(
        "controller",
        "OP rests while the error is small, or moves in stairs",
        {
            "width": Number(
                "PV units", low=0.0, identity=0.0, says="of the error in which OP rests"
            ),
            "step": Number("%", low=0.0, identity=0.0, says="of OP's stairs"),
        },
        _rest,
    ),
    "tuning": Form(
        "controller",
        "the same law with other numbers",
        {
            "gain": Number("-", low=0.0, positive=True, identity=1.0, says="factor of Kc"),
            "integral": Number("-", low=0.0, positive=True, identity=1.0, says="factor of Ti"),
        },
        _tuning,
    ),
    "bursts": Form(
        "disturbance",
        "a load that is strong in spells",
        {
            "std": Number("%", low=0.0, high=100.0, identity=0.0, says="at the plant's input"),
            "time": Number("s", low=0.0, positive=True, identity=10.0, says="its memory"),
            **_SPELLS,
        },
        _bursts,
    ),
}


def law_parameters(form: str, **fitted: float) -> dict[str, Number]:
    """Return the numbers of a form, as an effect's PARAMETERS, with the fitted values for
    defaults.

    Parameters
    ----------
    form : str
        Name of the form.
    **fitted : float
        Its numbers.

    Returns
    -------
    dict
        Parameters of the effect that simulates this law.
    """
    return {
        name: replace(rule, default=fitted.get(name, rule.identity))
        for name, rule in LAW_FORMS[form].numbers.items()
    }


def apply_law(form: str, setup: Any, p: Any, rng: np.random.Generator) -> None:
    """Do to a setup what a form with its numbers `p` does; where all are at their identity that is
    nothing.

    Parameters
    ----------
    form : str
        Name of the form.
    setup : Setup
        The loop before it runs; it is changed.
    p : named tuple
        Numbers of the form, as `Form.numbers` names them.
    rng : numpy.random.Generator
        Random numbers of the law.
    """
    if any(getattr(p, name) != rule.identity for name, rule in LAW_FORMS[form].numbers.items()):
        LAW_FORMS[form].act(setup, p, rng)
