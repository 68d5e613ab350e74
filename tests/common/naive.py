"""Slow, obvious detectors written from the equations of their papers: signals in, verdict and index
out.

They share no line with the product: loops in place of transforms, the samples of a half cycle as
they are, scipy's fits in place of closed forms. The papers do not say where a half cycle begins in
noise. Here, as in the product, it begins at the middle one of the changes of sign on the way to
beyond a quarter of the standard deviation, and lasts an eighth of the period to one period.
"""

import itertools

import numpy as np
from scipy.optimize import curve_fit


def horch_indices(op, pv):
    """Return dtau and drho of Eqs 11.6 and 11.7 with the cross-correlation summed lag by lag."""
    u, y = op - op.mean(), pv - pv.mean()

    def phi(lag):
        return u[: u.size - lag] @ y[lag:] if lag >= 0 else u[-lag:] @ y[: u.size + lag]

    def crossing(way):
        k = 0
        while (phi(way * k) > 0) == (phi(way * (k + 1)) > 0):
            k += 1
        return k + phi(way * k) / (phi(way * k) - phi(way * (k + 1)))

    right, left = crossing(1), crossing(-1)
    top = np.copysign(max(abs(phi(k)) for k in range(-int(left), int(right) + 1)), phi(0))
    return abs(left - right) / (left + right), abs(phi(0) - top) / abs(phi(0) + top)


def horch(op, pv):
    """Horch (1999), Eqs 11.8 and 11.9: verdict and dtau."""
    dtau, drho = horch_indices(op, pv)
    if dtau >= 2 / 3 and drho >= 1 / 3:
        return "stiction", dtau
    return ("no_stiction" if dtau <= 1 / 3 and drho <= 0.0718 else "no_decision"), dtau


_UNRELATED = {"IS": {"DD", "DI", "SD", "ID", "DS"}, "DS": {"DI", "SI", "ID", "II", "IS"}}
_FOLLOWS = {"IS": {"II", "SI"}, "DS": {"DD", "SD"}}


def yamashita_indices(op, mv, step=1):
    """Return rho1, rho2 and rho3 of Eqs 11.3 to 11.5, counted pair of symbols by pair of
    symbols.
    """

    def symbols(x):
        d = x[step:] - x[:-step]
        return ["I" if v > 1 else "D" if v < -1 else "S" for v in (d - d.mean()) / d.std()]

    pairs = [a + b for a, b in zip(symbols(op), symbols(mv), strict=True) if a + b != "SS"]
    runs = []
    for pair in pairs:
        if runs and runs[-1][0] == pair:
            runs[-1][1] += 1
        else:
            runs.append([pair, 1])
    rho1 = sum(pair in ("IS", "DS") for pair in pairs)
    rho2 = rho3 = 0
    for i, (pair, length) in enumerate(runs):
        if pair in ("IS", "DS"):
            after = runs[i + 1][0] if i + 1 < len(runs) else None
            rho2 += length * (after in _FOLLOWS[pair])
            rho3 += length * (after not in _UNRELATED[pair])
    return rho1 / len(pairs), rho2 / len(pairs), rho3 / len(pairs)


def yamashita(op, mv):
    """Yamashita (2006): verdict and rho3."""
    rho3 = yamashita_indices(op, mv)[2]
    return ("stiction" if rho3 > 0.25 else "no_stiction"), rho3


def half_cycles(x, period, points=None):
    """Yield the half cycles between zero crossings: times since the crossing, in shares of the half
    cycle, and heights.

    `points`: the number of points to which each is resampled; by default it keeps its samples.
    """
    x = x - x.mean()
    std, sign, at, changes = x.std(), 0, [], []
    for k in range(x.size):
        if k and (x[k] > 0) != (x[k - 1] > 0):
            changes.append(k - 1)
        if abs(x[k]) > 0.25 * std:
            side = 1 if x[k] > 0 else -1
            if side == -sign:
                j = changes[(len(changes) - 1) // 2]
                at.append(j + x[j] / (x[j] - x[j + 1]))
            sign, changes = side, []
    for start, stop in itertools.pairwise(at):
        if 0.125 * period < stop - start < period:
            k = np.arange(int(np.ceil(start)), int(np.floor(stop)) + 1)
            t, y = (k - start) / (stop - start), x[k]
            if points:
                t = (np.arange(points) + 0.5) / points
                y = np.interp(start + t * (stop - start), np.arange(x.size), x)
            yield t, y if y.sum() > 0 else -y


def _error(y, shape):
    return float(np.mean((y - max(shape @ y, 0.0) / (shape @ shape) * shape) ** 2))


def _fitted_sine_error(t, y):
    def sine(t, a, w):
        return a * np.sin(w * t)

    try:
        best, _ = curve_fit(sine, t, y, p0=(y.max(), np.pi), maxfev=2000)
    except (RuntimeError, TypeError):  # two or three samples of noise, to which no sine converges
        return _error(y, np.sin(np.pi * t))
    return float(np.mean((y - sine(t, *best)) ** 2))


def he(x, period, points=None):
    """He (2007), Eqs 11.10 to 11.13: a sine by nonlinear least squares against a triangle whose
    apex is searched.
    """
    sine, triangle = [], []
    for t, y in half_cycles(x, period, points):
        sine.append(_fitted_sine_error(t, y))
        triangle.append(
            min(
                _error(y, np.minimum(t / p, (1 - t) / (1 - p)))
                for p in np.linspace(0.02, 0.98, 200)
            )
        )
    if len(sine) < 4:
        return "no_decision", np.nan
    eta = np.mean(sine) / (np.mean(sine) + np.mean(triangle))
    return ("stiction" if eta >= 0.6 else "no_stiction" if eta <= 0.4 else "no_decision"), eta


def _relay_answer(t, tau):
    top = np.tanh(0.5 / tau)
    switch = 1 - tau * np.log1p(top)
    rising, falling = (
        1 - (1 + top) * np.exp(-(t - switch + 1) / tau),
        -1 + (1 + top) * np.exp(-(t - switch) / tau),
    )
    return np.where(t <= switch, rising, falling)


def rossi_scali(pv, period, points=None):
    """Rossi & Scali (2005), Eq 11.14: half a sine against the answers of first-order lags to a
    relay.
    """
    sine, relay = [], []
    for t, y in half_cycles(pv, period, points):
        sine.append(_error(y, np.sin(np.pi * t)))
        relay.append(min(_error(y, _relay_answer(t, tau)) for tau in np.geomspace(0.02, 200.0, 60)))
    if len(sine) < 4:
        return "no_decision", np.nan
    index = (np.mean(sine) - np.mean(relay)) / (np.mean(sine) + np.mean(relay))
    return (
        "stiction" if index > 0.21 else "no_stiction" if index < -0.21 else "no_decision"
    ), index


def singhal_salsbury(pv, period, points=None):
    """Singhal & Salsbury (2005): mean of the areas before over the areas after the peak, by
    trapezia between the samples.
    """
    ratios = []
    for t, y in half_cycles(pv, period, points):
        t, y = np.concatenate([[0.0], t, [1.0]]), np.concatenate([[0.0], y, [0.0]])
        top = int(np.argmax(y))
        ratios.append(np.trapezoid(y[: top + 1], t[: top + 1]) / np.trapezoid(y[top:], t[top:]))
    if len(ratios) < 4:
        return "no_decision", np.nan
    R = float(np.mean(ratios))
    return ("stiction" if R > 1 else "no_stiction"), R
