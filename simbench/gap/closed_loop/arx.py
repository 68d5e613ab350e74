"""Regress the controller and the plant of a record on their past, orders by BIC: what the samples
show of both, without a law or a plant of known form (ARX, Ljung 1999, System Identification,
section 4.2; BIC, Schwarz 1978, Annals of Statistics 6, 461).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from simbench.gap.controller.regression import solve_least_squares
from simbench.loop import plant as plants
from simbench.scenarios.plant import Plant

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
    new, old = (_numerator_over(g.A, B, g.C, den) for B in (g.B_new, g.B_old))
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
        columns = [*range(past), *range(most_past, most_past + inputs), X.shape[1] - 1]
        b = solve_least_squares(R[:, columns], R[:, -1])
        if past and np.abs(np.roots(np.append(1.0, -b[:past]))).max() >= 1.0:
            continue
        left = now - X[:, columns] @ b
        size = max(float(left @ left) / rows, 1e-18)
        bic = rows * np.log(size) + len(columns) * np.log(rows)
        yield Arx(b[:past], b[past:-1], first, float(b[-1]), left, float(bic))


def _least_bic(models: Iterable[Arx]) -> Arx | None:
    return min(models, key=lambda one: one.bic, default=None)
