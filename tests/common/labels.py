"""The labels of a scenario a second time: written from the contract alone (section 5), slowly, with
nothing of simbench.bench.

It shares the simulator (which has other twins) and the random streams, and nothing else:
reversals, swings, periods, sine amplitudes, the band of a valve, Table 11.3 and its refinement are
worked out here again.
"""

import math
from itertools import pairwise

import numpy as np

from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup

PERIODS = 20  # of the tail
LONGEST = 20_000  # samples of it
SMOOTH = {"ideal", "deadzone", "lag", "limits", "gain_ratio", "characteristic"}
WIDTH = 100.0 / (52538.0 * 0.1016)  # % of travel per newton of the published actuator


def friction_band(loop):
    """Return (S, J) in % of travel; (0, 0) without friction."""
    name, p = loop.valve.name, loop.valve.parameters
    for effect in loop.effect:
        if effect.name in ("stiction", "deadband"):
            return float(effect.parameters["S"]), float(effect.parameters.get("J", 0.0))
    if name in SMOOTH:
        return 0.0, 0.0
    if name == "deadband":
        return float(p["S"]), 0.0
    if name == "coulomb_viscous":
        return (float(p["S"]) if "S" in p else 2.0 * p["Fc"] * WIDTH), 0.0
    if name == "stenman":
        return float(p["d"]), float(p["d"])
    if name == "hysteresis":
        return float(p.get("S", 0.0) + p["H"]), 0.0
    if name == "asymmetric":
        return (p["S_up"] + p["S_down"]) / 2.0, (p["J_up"] + p["J_down"]) / 2.0
    if name == "time_varying":
        return float(p.get("S_end", p["S"])), float(p.get("J_end", p["J"]))
    if name == "he":
        S, J = (p["S"], p["J"]) if "S" in p else (p["fs"] + p["fd"], p["fs"] - p["fd"])
        more = p.get("K", 1.0) - 1.0
        return S - more * J, J + more * J
    if "Fs" in p:
        per = 100.0 / (p.get("k", 52538.0) * p.get("stroke", 0.1016))
        return per * (p["Fs"] + p["Fc"]), per * (p["Fs"] - p["Fc"])
    return float(p["S"]), float(p["J"])


def table_11_3(loop):
    """Return the entry of Table 11.3: True, False, or None where it has no cell."""
    if loop.valve.name == "deadzone":
        return None
    S, J = friction_band(loop)
    if S == 0.0:
        return False
    if loop.plant.type == "integrating":
        return True if loop.controller.type == "PI" else J > 0.0
    return loop.controller.type == "PI" and J > 0.0


def refined(loop):
    """Return the table with the exact condition of a self-regulating plant under P: K Kc J > S."""
    printed = table_11_3(loop)
    if printed is not None and loop.plant.type == "foptd" and loop.controller.type == "P":
        S, J = friction_band(loop)
        return J > 0.0 and abs(loop.plant.K) * loop.controller.Kc * J > S
    return printed


def turning_points(x, least):
    """Return [(index, value)] where x turns by more than `least`; the first and the last stretch
    have no turn.
    """
    turns = []
    top = low = (0, x[0])
    direction = 0
    for i, value in enumerate(x):
        if value >= top[1]:
            top = (i, value)
        if value <= low[1]:
            low = (i, value)
        if direction >= 0 and top[1] - value > least:
            if direction > 0:
                turns.append(top)
            direction, low = -1, (i, value)
            top = low
        elif direction <= 0 and value - low[1] > least:
            if direction < 0:
                turns.append(low)
            direction, top = 1, (i, value)
            low = top
    return turns


def swings_of(turns):
    return np.array([abs(b[1] - a[1]) for a, b in pairwise(turns)])


def period_of(turns):
    """Return the period in samples: twice the mean distance of turns."""
    return 2.0 * (turns[-1][0] - turns[0][0]) / (len(turns) - 1)


def largest_sine(x, period):
    """Return the largest amplitude of a sine in x at any period within a factor 3 of `period`
    (samples).
    """
    x = np.asarray(x) - np.mean(x)
    k = np.arange(x.size)
    best = 0.0
    for P in np.geomspace(period / 3.0, period * 3.0, 400):
        if P > 2.0:
            best = max(best, 2.0 / x.size * abs(np.sum(x * np.exp(-2j * math.pi * k / P))))
    return best


def fading(turns, n):
    """Return the median swing of the last third of n samples over that of the first; 0 when the
    last third is still.
    """
    first, last = [], []
    for (i, x), (k, y) in pairwise(turns):
        if (i + k) / 2.0 < n / 3.0:
            first.append(abs(y - x))
        if (i + k) / 2.0 >= 2.0 * n / 3.0:
            last.append(abs(y - x))
    if not last:
        return 0.0
    return float(np.median(last) / np.median(first)) if first else math.inf


def cycled(loop, seed, plain=False):
    """Return yes, no, entrained or unclear."""
    S, J = friction_band(loop)
    if S == 0.0:
        return "no"
    swing = J / 2.0 if J > 0.0 else S / 20.0
    n = loop.sampling.n
    setup = resolve_loop(loop, seed)
    record = run_setup(setup, plain=plain).mv
    late = slice(n // 2, n)
    turns = turning_points(record[late], swing / 4.0)
    P = period_of(turns) if len(turns) >= 3 else (n - 1) / PERIODS
    answers = [
        alone(loop, seed, n - round(quarter * P / 4.0), P, swing, plain) for quarter in range(4)
    ]
    if "yes" in answers:
        return "yes"
    if "unclear" in answers:
        return "unclear"
    warm_up = loop.sampling.warm_up or 0
    driven = any(np.ptp(x[warm_up:][late]) > 0 for x in (setup.load_in, setup.load_out, setup.sp))
    steady = fading(turns, record[late].size) >= 0.8
    if not driven and steady and len(turns) >= 6 and np.median(swings_of(turns)) >= swing:
        return "unclear"
    if loop.noise.std > 0:
        moved, _ = tail_of(loop, seed, None, P, swing, plain)
        if len(moved[0]) >= 6 and np.median(swings_of(moved[0])) >= swing and fading(*moved) >= 0.5:
            return "unclear"
    return "entrained" if driven and np.ptp(record[late]) >= swing else "no"


def alone(loop, seed, off, P, swing, plain):
    """Return whether the loop cycles without noise from sample `off` on: yes, no, or unclear."""
    (turns, size), mv = tail_of(loop, seed, off, P, swing, plain)
    if len(turns) < 6:
        # a single swing within the last third: too slow to be distinguished from a drift
        return "unclear" if turns and np.ptp(mv[-(size // 3) :]) >= swing else "no"
    last_to_first = fading(turns, size)
    if np.median(swings_of(turns)) < swing or last_to_first < 0.5:
        return "no"
    period = period_of(turns)
    other = after_record(without_friction(loop), seed, off, size, plain)
    if largest_sine(other, period) >= 0.5 * largest_sine(mv, period):
        return "unclear"
    return "yes" if last_to_first >= 0.8 else "unclear"


def without_friction(loop):
    table = loop.to_table()
    table["valve"] = {"model": "ideal"}
    table["effect"] = [
        e for e in table.get("effect", []) if e["name"] not in ("stiction", "deadband")
    ]
    return type(loop).from_table(table)


def tail_of(loop, seed, off, P, swing, plain):
    """Return ((turns, samples), MV) over 20 periods after the record, of the motion of the loop if
    that is slower than P.
    """
    size = min(max(math.ceil(PERIODS * P), 3 * PERIODS), LONGEST)
    while True:
        mv = after_record(loop, seed, off, size, plain)
        turns = turning_points(mv, swing / 4.0)
        slower = period_of(turns) if len(turns) > 2 else 2.0 * size / PERIODS
        wanted = min(max(math.ceil(PERIODS * slower), 3 * PERIODS), LONGEST)
        if np.ptp(mv[size // 2 :]) < swing or wanted <= 1.25 * size or size >= LONGEST:
            return (turns, size), mv
        size = wanted


def after_record(loop, seed, off, size, plain):
    """Return MV after the record: loads and set point frozen at its end, no noise from sample
    `off` on.
    """
    setup = resolve_loop(loop, seed, size)
    if off is not None:
        setup.pv_add[(loop.sampling.warm_up or 0) + off :] = 0.0
    return run_setup(setup, plain=plain).mv[loop.sampling.n :]
