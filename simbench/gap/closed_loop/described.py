"""Say in the numbers that people know what a loop of any order acts like: K, T, Td of its plant,
Kc, Ti, Td of its controller, and its gain margin.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.closed_loop.copies import AS_SHOWN, Copy, in_samples
from simbench.loop import plant as plants
from simbench.scenarios.plant import Controller, Plant
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import phase_crossings

# frequencies at which a controller is compared with PID: from a wave as long as so many samples to
# one of so many
_WAVES = (400.0, 10.0)
_POINTS = 400
FREQUENCIES = np.geomspace(1e-4, np.pi, 20_000)  # of a loop's response, radians per sample
_LITTLE = 0.1  # of a sample: a derivative time below it is none


def described(loop: Loop) -> list[str]:
    """Return plant, controller and gain margin in words, a sentence each.

    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
    ...     "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0}, "sampling": {"Ts": 1.0}})
    >>> described(loop)[0]
    'The plant is of first order: K = 1, T = 10 s, Td = 2 s.'
    >>> described(loop)[1:]
    ['The controller is PI: Kc = 1, Ti = 10 s.', 'The gain margin is 5.9.']
    """
    lines = [
        f"The plant {_describe_plant(loop.plant)}.",
        f"The controller {controller_words(loop)}.",
    ]
    margin = gain_margin(loop)
    if np.isfinite(margin):
        return lines + [f"The gain margin is {margin:.2g}."]
    return lines


def _describe_plant(plant: Plant) -> str:
    like = plants.first_order_like(plant)
    numbers = {"K": f"{like.K:.3g}", "T": like.T and f"{like.T:.3g} s", "Td": f"{like.Td:.3g} s"}
    said = ", ".join(f"{name} = {value}" for name, value in numbers.items() if value)
    if plant.den is None or len(plant.den) == 2:
        return f"{'integrates' if plant.integrating else 'is of first order'}: {said}"
    order = np.trim_zeros(np.array(plant.den), "b").size - 1
    kind = "an integrating one" if plant.integrating else "one of first order"
    return f"is of order {order} and acts like {kind}: {said}"


def controller_words(loop: Loop) -> str:
    """Return what a loop's controller is, or acts like, in words that follow its name."""
    # A controller in the field's words has its numbers
    c = loop.controller
    if c.type != "tf":
        own = {"Kc": f"{c.sign * c.Kc:.3g}", "Ti": c.Ti and f"{c.Ti:.3g} s"}
        own |= {"Td": c.Td and f"{c.Td:.3g} s"}
        return f"is {c.type}: " + ", ".join(f"{k} = {v}" for k, v in own.items() if v)

    # A filter in powers of z acts like a PID at low frequency
    Kc, Ki, Kd = _like_pid(c, loop.sampling.Ts)
    if Ki:
        Ti = Kc / Ki
    else:
        Ti = np.inf
    if Kc:
        Td = Kd / Kc
    else:
        Td = 0.0

    # Its derivative, or what it acts late by, where either is more than a little
    kind = "PI" if np.isfinite(Ti) else "P"
    said = f"Kc = {Kc:.3g}"
    if np.isfinite(Ti):
        said += f", Ti = {Ti:.3g} s"
    if Td > _LITTLE * loop.sampling.Ts:
        kind = f"{kind}D"
        said = f"{said}, Td = {Td:.3g} s"
    elif Td < -_LITTLE * loop.sampling.Ts:
        said += f", late by {-Td:.3g} s"
    order = np.trim_zeros(np.array(c.den), "b").size - 1
    return f"is of order {order} and acts like {kind}: {said}"


def shown_words(copy: Copy, block: str) -> str:
    """Return in words which part of a stated loop the record shows otherwise, and how."""
    if block == "controller":
        return f"the controller {controller_words(copy.loop)}"
    if copy.plant == AS_SHOWN:
        return f"the plant {_describe_plant(copy.loop.plant)}"
    if block == "disturbance":
        return "the load is of another kind than the loop file states"
    return "a load that is drawn again from the record stands for it"


def _like_pid(c: Controller, Ts: float) -> tuple[float, float, float]:
    """Return Kc, Ki (per s) and Kd (s) of the PID that is nearest to a controller in powers of z,
    by least squares of its response relative to its size (Levy 1959).
    """
    w = np.geomspace(*(2.0 * np.pi / (wave * Ts) for wave in _WAVES), _POINTS)
    s = 1j * w
    z = np.exp(1j * w * Ts)
    law = c.sign * np.polyval(c.num or (), z) / np.polyval(c.den or (), z)
    X = np.column_stack([np.ones_like(s), 1.0 / s, s]) / np.abs(law)[:, None]
    y = law / np.abs(law)
    both = np.vstack([X.real, X.imag]), np.concatenate([y.real, y.imag])
    Kc, Ki, Kd = np.linalg.lstsq(*both, rcond=None)[0]
    return float(Kc), float(Ki), float(Kd)


def gain_margin(loop: Loop) -> float:
    """Return the factor on the loop's gain at which it begins to oscillate, by its sampled
    response; inf where there is none.
    """
    L = open_loop(loop)
    if L is None:
        return np.inf
    crossings = phase_crossings(L)
    if crossings.size:
        return float(1.0 / np.abs(L[crossings[0]]))
    return np.inf


def open_loop(loop: Loop) -> np.ndarray | None:
    """Return a loop's sampled response at `FREQUENCIES` (n,), the plant's sign taken out; None of a
    controller that has none.
    """
    # the controller
    Ts = loop.sampling.Ts
    z = np.exp(1j * FREQUENCIES)
    c = loop.controller
    if c.type == "tf":
        law = np.polyval(c.num or (), z) / np.polyval(c.den or (), z)
    elif c.type in ("P", "PI"):
        law = c.Kc * (1.0 if c.Ti is None else 1.0 + Ts / c.Ti * z / (z - 1.0))
    else:
        return None

    # behind it the plant
    num, den = in_samples(loop.plant, Ts)
    plant = np.polyval(num[::-1], 1.0 / z) / np.polyval(den[::-1], 1.0 / z)
    return c.sign * law * plant
