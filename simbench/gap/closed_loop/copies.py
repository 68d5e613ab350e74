"""Loops that copy a record: the plant of first order that was fitted, or one of the order that its
samples show, under a load that is drawn again from what both leave.

The load of a real plant is no Gaussian process: it rests, jumps and comes in bursts. Pieces of what
a record left keep that, and noise of the same spectrum does not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from simbench.detectors.signal.filters import lfilter
from simbench.gap.closed_loop.as_archived import digits_of
from simbench.gap.closed_loop.gap import held_out
from simbench.gap.closed_loop.level import WITHIN, kick_of, moved
from simbench.gap.controller.law import solve_least_squares
from simbench.gap.situation import Situation, through_valve
from simbench.loop import plant as plants
from simbench.loop.effects import block_of
from simbench.scenarios.errors import SpecError
from simbench.scenarios.parts import Archiving, Noise, Part
from simbench.scenarios.plant import Plant
from simbench.scenarios.spec import Loop

# samples of a piece: a third of the period of the swing, so that no cycle hides in one, within
# these; and as many as a load needs that moves seldom
_SHORT = (3, 20)
_LONG = 100
_SPARED = 3  # pieces at least that the residuals must hold
_MIDDLE = 50.0  # of OP's travel, where an OP of unknown unit is simulated
_AT_LIMIT = 0.02  # share of OP's samples at its largest or smallest value, from which it is a limit


AS_STATED = "as stated"
AS_SHOWN = "as the samples show"


# the table of a plant, OP at which it rests, what it leaves of PV, and the filter that this passes
_Left = tuple[dict[str, Any], float, np.ndarray, list[float] | None]


class Copy(NamedTuple):
    """A loop that copies a record, and in words what it is made of."""

    loop: Loop
    plant: str  # "as stated", "first order" or "as the samples show"
    load: str  # "as stated", "Gaussian", or how long the pieces are (s)


def copies(s: Situation, fitted: Loop, effects: Sequence[Mapping[str, Any]]) -> Iterator[Copy]:
    """Yield the loops that may copy a record, the plainest first: the fitted one, and those whose
    load is drawn again; `effects` are those of the valve in all of them.
    """
    # The fitted loop itself, unless OP lies outside of travel
    given, s, end = s, _in_travel(s), held_out(s)
    if s is given:
        yield Copy(fitted, "first order", "Gaussian")

    # The controller's law by regression on the part that fits are made of
    op = s.op[:end]
    pv = s.record.pv[:end]
    sp = s.sp[:end]
    law = regress_law(op, sp - pv)
    if law is None:
        return

    # Where the valve stood under OP, with the effects
    position = op
    kick = max((kick_of(effect) for effect in effects), default=0.0)
    for effect in effects:
        position = through_valve(position, s.baseline, s.record.Ts, effect)

    # The plant as it was fitted, and as a regression shows it
    tables: list[tuple[str, _Left]] = [
        ("first order", _leave_by_plant(fitted.plant, position, pv, s))
    ]
    plant_shown = regress_plant(position, pv)
    if plant_shown is not None:
        tables.append((AS_SHOWN, _leave_by_regression(plant_shown, s, s.record.Ts)))

    # Copies with what each plant leaves, drawn again
    around = _surrounding_loop(s, fitted, effects).replace(
        controller=controller_of(law, s.record.Ts)
    )
    of_op = {"op": (law.left + law.constant).tolist()}
    for copy in _redraw_loads(s, s.record.Ts, tables, around, of_op):
        yield copy._replace(loop=moved(copy.loop, kick))


def _redraw_loads(
    s: Situation,
    Ts: float,
    tables: Sequence[tuple[str, _Left]],
    around: Loop,
    of_op: Mapping[str, list[float]],
) -> Iterator[Copy]:
    """Yield loops of some plants whose load is drawn again from what they leave of PV, and from
    what a controller left of OP, in short pieces and in long ones.
    """
    # Each plant with pieces of several lengths of what it leaves
    for name, (plant, op0, left, law_of_left) in tables:
        for piece in _piece_lengths(s.op[: held_out(s)], left.size):
            numbers = {"piece": piece * Ts, **of_op, "output": left.tolist()}
            if law_of_left is not None:
                numbers |= {"filter": law_of_left}
            load = Part(name="resampled", parameters=numbers)
            rest = {"op0": op0, "pv0": float(s.sp[0])}

            # A copy that can be stated as a loop
            try:
                copy = around.replace(plant=plant, operating_point=rest, disturbance=(load,))
                yield Copy(copy, name, f"{piece * Ts:.3g}")
            except SpecError:
                continue  # a pole at the edge of stability


def shown(s: Situation, loop: Loop, block: str) -> Iterator[Copy]:
    """Yield copies of a stated loop in which one part is as the record shows it, the plainest
    first: its controller or its load, and, where process or load is otherwise, its plant as well:
    what a plant of another order leaves remembers as a load does.
    """
    if s.pace > 1:
        return  # what happens between its samples no record shows
    if block == "controller":
        yield from _with_shown_law(s, loop)
    elif all(e.name == "quantisation" or block_of(e.name) != "sensor" for e in loop.effect):
        # what a sensor that is stated does to a load cannot be undone; rounding hardly changes it
        yield from _with_shown_load(s, loop, plant_too=block in ("process", "disturbance"))


def _with_shown_law(s: Situation, loop: Loop) -> Iterator[Copy]:
    """Yield a loop with the controller that the record shows in place of its own, what that leaves
    of OP drawn again.
    """
    end = held_out(s)
    op = s.op[:end]
    law = regress_law(op, s.sp[:end] - s.record.pv[:end])
    if law is None:
        return
    left = (law.left + law.constant).tolist()

    # the period that the file states: that of the record may differ from it by its clock
    Ts = loop.sampling.Ts
    piece = _piece_lengths(op, law.left.size)[0] * Ts
    load = Part(name="resampled", parameters={"piece": piece, "op": left})
    try:
        shown_law = loop.replace(
            controller=controller_of(law, Ts), disturbance=(load,) + loop.disturbance
        )
        yield Copy(shown_law, AS_STATED, AS_STATED)
    except SpecError:
        return  # it acts the other way


def _with_shown_load(s: Situation, loop: Loop, plant_too: bool) -> Iterator[Copy]:
    """Yield a loop whose load is drawn again from what its plant leaves of PV, then one with the
    plant that the record shows, if that is asked for.
    """
    end = held_out(s)
    Ts = loop.sampling.Ts
    op = s.op[:end]
    pv = s.record.pv[:end]
    position = through_valve(op, loop, Ts)
    tables: list[tuple[str, _Left]] = [(AS_STATED, _leave_by_plant(loop.plant, position, pv, s))]
    if plant_too and (plant := regress_plant(position, pv)) is not None:
        tables.append((AS_SHOWN, _leave_by_regression(plant, s, Ts)))
    yield from _redraw_loads(s, Ts, tables, loop.replace(noise=Noise()), {})


def _in_travel(s: Situation) -> Situation:
    """Return a situation whose OP lies in 0 to 100: where its unit is not known, about 50."""
    if s.op.min() >= 0.0 and s.op.max() <= 100.0:
        return s
    return replace(s, op=s.op + (_MIDDLE - float(s.op.mean())))


def archived(loop: Loop, s: Situation, held: bool) -> Loop:
    """Return a loop that states how its record is written: in the steps of the recorded samples,
    and (`held`) repeated where these repeat their last value.
    """
    op_step, pv_step = map(float, digits_of(s))
    return loop.replace(
        archive=Archiving(
            op_step=op_step,
            pv_step=pv_step,
            op_held=_mark_repeats(s.op) if held else None,
            pv_held=_mark_repeats(s.record.pv) if held else None,
        )
    )


def _mark_repeats(x: np.ndarray) -> tuple[int, ...] | None:
    """Return 1 for every sample that repeats the one before, and 0 for the others; None where none
    does.
    """
    same = np.diff(x) == 0.0
    if same.any():
        return (0, *same.astype(int).tolist())
    return None


def _surrounding_loop(s: Situation, fitted: Loop, effects: Sequence[Mapping[str, Any]]) -> Loop:
    """Return a loop with the set point, the sampling and the valve of the fitted one, the effects
    on the valve and the limits of OP; its plant and controller are to be replaced.
    """
    op = s.op
    limits = {}
    for name, end in (("lo", float(op.min())), ("hi", float(op.max()))):
        if np.mean(op == end) > _AT_LIMIT:
            limits[name] = end
    parts = [Part.of("effect", effect) for effect in effects]
    if limits:
        parts.append(Part(name="saturation", parameters=limits))
    return fitted.replace(
        effect=tuple(parts), noise=Noise(), archive=None, disturbance=(), outer=None
    )


def controller_of(law: Arx, Ts: float) -> dict[str, Any]:
    """Return the table of a controller whose changes of OP follow a regression."""
    den = np.convolve(law.den, [1.0, -1.0])
    num = law.driven
    size = max(den.size, num.size)
    den = np.append(den, np.zeros(size - den.size))
    num = np.append(num, np.zeros(size - num.size))
    return {"type": "tf", "num": num.tolist(), "den": den.tolist(), "dt": Ts}


def _leave_by_regression(plant: Arx, s: Situation, Ts: float) -> _Left:
    """Return the table of a plant that was regressed, OP at which it rests on the first set point,
    its residuals with what is left of that, and the filter they pass.
    """
    # The regressed plant as a table in powers of z
    den = plant.den
    num = plant.driven
    size = max(den.size, num.size + 1)
    table = {
        "type": "tf",
        "num": np.append(num, np.zeros(size - 1 - num.size)).tolist(),
        "den": np.append(den, np.zeros(size - den.size)).tolist(),
        "dt": Ts,
    }

    # OP at rest on the first set point, and what is left about it
    rest = float(den.sum()) * float(s.sp[0])
    gain = float(num.sum())
    op0 = _resting_op((rest - plant.constant) / gain if gain else np.nan, s)
    return table, op0, plant.left + plant.constant - (rest - gain * op0), den.tolist()


def _leave_by_plant(plant: Plant, position: np.ndarray, pv: np.ndarray, s: Situation) -> _Left:
    """Return as `_leave_by_regression` does what a given plant leaves: noise on PV that follows
    from its own past.
    """
    num, den = in_samples(plant, s.record.Ts)
    about = float(np.mean(position))
    if plant.integrating:
        # what PV moves by in a sample
        den = np.cumsum(den)[:-1]
        gain = float(num.sum() / den.sum())
        moved = np.asarray(lfilter(num, den, position - about)) + gain * about
        noise = regress_noise(np.diff(pv, prepend=pv[0]) - moved)
        op0 = _resting_op(-noise.constant / noise.den.sum() / gain, s)
        left = noise.left + noise.constant + noise.den.sum() * gain * op0
        law = np.convolve(noise.den, [1.0, -1.0])
    else:
        noise = regress_noise(pv - np.asarray(lfilter(num, den, position - about)))
        level = noise.constant / float(noise.den.sum())  # PV at the mean position
        op0 = _resting_op(about + (float(s.sp[0]) - level) / plant.K, s)
        off = level + plant.K * (op0 - about) - float(s.sp[0])
        left = noise.left + off * float(noise.den.sum())
        law = noise.den
    table = plant.model_dump(exclude_none=True)
    return table, op0, left, law.tolist() if law.size > 1 else None


def _resting_op(op0: float, s: Situation) -> float:
    """Return OP at rest; its mean on record where that lies outside of its travel."""
    if WITHIN[0] <= op0 <= WITHIN[1]:
        return float(op0)
    return float(np.clip(s.op.mean(), *WITHIN))


def _piece_lengths(op: np.ndarray, samples: int) -> list[int]:
    """Return the lengths of pieces (samples) that are tried."""
    # the mean spectrum of overlapping halves (Welch 1967)
    half = op.size // 2
    parts = np.array([op[k : k + half] for k in (0, (op.size - half) // 2, op.size - half)])
    parts = (parts - parts.mean(axis=1, keepdims=True)) * np.hanning(half)
    power = (np.abs(np.fft.rfft(parts)) ** 2).mean(axis=0)
    third = int(np.clip(half / (1 + np.argmax(power[1:])) / 3.0, *_SHORT))
    return sorted({min(piece, max(samples // _SPARED, 1)) for piece in (third, _LONG)})


# --- Regress the controller and the plant of a record on their past, orders by BIC: what the
# samples show of both, without a law or a plant of known form (ARX, Ljung 1999, System
# Identification, section 4.2; BIC, Schwarz 1978, Annals of Statistics 6, 461).

# orders that are tried: of OP's past changes and past errors, of PV's past and of MV's
_LAW = tuple(product((0, 1, 2, 4), (1, 2, 4, 8)))
_PLANT = tuple(product((1, 2, 3, 5, 8), (1, 2, 4, 8, 12, 20)))
_VESSEL = tuple(product((0, 1, 2, 4, 7), (1, 2, 4, 8, 12, 20)))
_MOST = 20  # samples that the longest of them looks back


@dataclass(frozen=True, eq=False)
class Arx:
    """y(t) = sum past_i y(t - i) + sum driven_j x(t - first - j) + constant + left(t).

    `left` has shape (m - 20,), from sample 20 on of the m that were fitted; `bic` is lower for a
    better model.
    """

    past: np.ndarray
    driven: np.ndarray
    first: int
    constant: float
    left: np.ndarray
    bic: float

    @property
    def den(self) -> np.ndarray:
        """Numbers of the polynomial in z that y passes, 1 first."""
        return np.append(1.0, -self.past)


def regress_law(op: np.ndarray, error: np.ndarray) -> Arx | None:
    """Return how changes of OP follow from their past and from the error; None where nothing that
    is stable fits.
    """
    return _least_bic(_stable_models(np.diff(op, prepend=op[0]), error, _LAW, first=0))


def regress_plant(position: np.ndarray, pv: np.ndarray) -> Arx | None:
    """Return how PV follows from its past and from a valve's position; of models with an integrator
    `past` holds it.
    """
    found = [_least_bic(_stable_models(pv, position, _PLANT, first=1))]
    slope = _least_bic(_stable_models(np.diff(pv, prepend=pv[0]), position, _VESSEL, first=1))
    if slope is not None:
        past = -np.convolve(slope.den, [1.0, -1.0])[1:]
        found.append(Arx(past, slope.driven, 1, slope.constant, slope.left, slope.bic))
    return min((one for one in found if one is not None), key=lambda one: one.bic, default=None)


def regress_noise(noise: np.ndarray) -> Arx:
    """Return how a signal follows from its own past."""
    orders = [(order, 0) for order in range(9)]
    found = _least_bic(_stable_models(noise, np.zeros(noise.size), orders, first=1))
    if found is None:
        left = noise[_MOST:] - noise[_MOST:].mean()
        found = Arx(np.zeros(0), np.zeros(0), 1, float(noise[_MOST:].mean()), left, np.inf)
    return found


def in_samples(plant: Plant, Ts: float) -> tuple[np.ndarray, np.ndarray]:
    """Return num and den of a sampled plant in rising powers of 1/z, dead time included."""
    if plant.dt is not None:
        late = np.zeros(round(plant.Td / plant.dt) + 1)
        return np.append(late, plant.num or ()), np.array(plant.den)
    g = plants.sample(*plants.polynomials(plant), plant.Td, Ts)
    den = np.real(np.poly(g.A))
    late = np.zeros(g.delay)
    new = _numerator_over(g.A, g.B_new, g.C, den)
    old = _numerator_over(g.A, g.B_old, g.C, den)
    return np.concatenate([late, np.append(new, 0.0) + np.append(0.0, old)]), den


def _numerator_over(A: np.ndarray, B: np.ndarray, C: np.ndarray, den: np.ndarray) -> np.ndarray:
    """Return the numbers of C (zI - A)^-1 B over `den`, by its impulse response."""
    response = np.zeros(den.size)
    x = B
    for lag in range(1, den.size):
        response[lag] = C @ x
        x = A @ x
    return np.convolve(response, den)[: den.size]


def _stable_models(
    y: np.ndarray, x: np.ndarray, orders: Iterable[tuple[int, int]], first: int
) -> Iterator[Arx]:
    """Yield the models of all orders that are stable; all are fitted to the same samples."""
    # The regressors of the longest order, and the constant
    orders = list(orders)
    most_past, most_driven = (max(order[k] for order in orders) for k in (0, 1))
    if most_driven:
        driven = range(first, most_driven + 1)
    else:
        driven = ()
    rows = y.size - _MOST
    lagged = [y[_MOST - i : y.size - i] for i in range(1, most_past + 1)]
    lagged += [x[_MOST - j : x.size - j] for j in driven]
    X = np.column_stack(lagged + [np.ones(rows)])
    now = y[_MOST:]

    # of an orthogonal basis every order is a few columns
    R = np.linalg.qr(np.column_stack([X, now]), mode="r")
    for past, last in orders:
        if last:
            inputs = max(last - first + 1, 0)
        else:
            inputs = 0
        columns = list(range(past)) + list(range(most_past, most_past + inputs)) + [X.shape[1] - 1]
        b = solve_least_squares(R[:, columns], R[:, -1])
        if past and np.abs(np.roots(np.append(1.0, -b[:past]))).max() >= 1.0:
            continue
        left = now - X[:, columns] @ b
        size = max(float(left @ left) / rows, 1e-18)
        bic = rows * np.log(size) + len(columns) * np.log(rows)
        yield Arx(b[:past], b[past:-1], first, float(b[-1]), left, float(bic))


def _least_bic(models: Iterable[Arx]) -> Arx | None:
    return min(models, key=lambda one: one.bic, default=None)
