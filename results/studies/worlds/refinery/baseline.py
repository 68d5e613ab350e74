"""The baseline's first-order model of a plant with small extra lags: the step responses agree as
well as they can.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares


def step_response(t: np.ndarray, T: float, lags: tuple[float, ...]) -> np.ndarray:
    """Return the unit step response of 1/((T s + 1)(lag1 s + 1) ...), lags unlike each other, by
    superposition of its modes.
    """
    taus = [x for x in (T, *lags) if x > 0.0]
    y = np.ones_like(t)
    for i, tau in enumerate(taus):
        weight = tau ** (len(taus) - 1) / np.prod(
            [tau - other for j, other in enumerate(taus) if j != i]
        )
        y -= weight * np.exp(-np.maximum(t, 0.0) / tau)
    return np.where(t > 0.0, y, 0.0)


def fitted(plant: dict) -> dict:
    """Return type, K, T, Td of the first-order model whose step response comes closest to the
    plant's, the small lags of its instruments included.
    """
    lags = tuple(plant.get(name, 0.0) for name in ("lag1", "lag2", "actuator", "filter"))
    model = {name: plant[name] for name in ("type", "K", "T", "Td")}
    if plant["type"] == "integrating":
        # the ramps lie on one line once the lags have died away
        return {**model, "Td": plant["Td"] + sum(lags)}
    if not any(lags):
        return model
    T = plant["T"]
    t = np.linspace(0.0, 5.0 * T, 400)
    goal = step_response(t, T, lags)
    fit = least_squares(
        lambda x: step_response(t - x[1], x[0], (0.0, 0.0)) - goal,
        [T, sum(lags)],
        x_scale=[T, 0.1 * T],
    )
    return {**model, "T": float(fit.x[0]), "Td": plant["Td"] + float(fit.x[1])}
