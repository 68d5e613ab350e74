"""Judge whether a loop file makes an answer worse: loops of a plain simulator of its own, sticky
and healthy, asked with their file and without it, and healthy ones with and without one nuisance.

The plant moves in ten substeps a sample under a stem that slips within it; a file states K, T and
Td up to 7 % off, and the load whole, by half or not at all.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from simbench.bench.statistics import wilson
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import STICTION
from simbench.gap.diagnosis import conclude, diagnose
from simbench.gap.effects import is_friction
from simbench.loop.effects import NONE, UNKNOWN
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

PLANTS = ("self-regulating", "second order", "integrating")
STATED = (1.0, 0.5, 0.0)  # share of the load that the file states
NUISANCES = ("card", "fast controller", "slipping clock")
REST = 50.0  # OP (%) and PV at rest
WARM_UP = 300  # samples before the record
OFF = 0.07  # share by which a file's plant is off


@dataclass(frozen=True)
class Case:
    """One loop, its unit of time a sample; `steps` are those of its set point."""

    plant: str
    n: int
    K: float
    T: float
    T2: float
    Td: float
    Kc: float
    Ti: float
    S: float
    J: float
    noise: float
    load: float
    period: float
    stem: float  # time constant of the stem's actuator
    steps: tuple[tuple[int, float], ...]
    substeps: int = 10
    runs: int = 1  # of the controller, a sample
    card: float = 0.0  # step of PV


def draw(rng: np.random.Generator, i: int, sticky: bool) -> Case:
    """Return the i-th loop: plants in turn, tuned by lambda, its numbers at random."""
    # a plant and its controller
    plant = PLANTS[i % 3]
    n = int(rng.integers(1200, 2500))
    T, Td = rng.uniform(6.0, 40.0), rng.uniform(1.0, 8.0)
    T2 = rng.uniform(0.2, 0.6) * T if plant == "second order" else 0.0
    size = math.exp(rng.uniform(-1.0, 1.0))
    aggressive = rng.uniform(0.6, 1.3)
    if plant == "integrating":
        K, pace = 0.03 * size, max(3.0 * Td, 8.0) * rng.uniform(1.0, 2.0)
        Kc, Ti = aggressive * (2.0 * pace + Td) / (K * (pace + Td) ** 2), 2.0 * pace + Td
    else:
        K, lead, wait = size, T + 0.5 * T2, Td + 0.5 * T2
        pace = max(wait, 0.5 * lead) * rng.uniform(0.8, 2.0)
        Kc, Ti = aggressive * lead / (K * (pace + wait)), min(lead, 4.0 * (pace + wait))

    # what moves it, in the size of one percent of OP on PV
    unit = 20.0 * K if plant == "integrating" else K
    S = rng.uniform(1.0, 10.0) if sticky else 0.0
    at = np.sort(rng.integers(100, n - 100, rng.integers(2, 6) if rng.random() < 0.5 else 0))
    steps = tuple((int(k), float(unit * rng.uniform(-6.0, 6.0))) for k in at)
    numbers = (K, T, T2, Td, Kc, Ti, S, rng.uniform(0.1, 0.8) * S, unit * rng.uniform(0.02, 0.15))
    load = rng.uniform(0.05, 0.4) * (0.5 if plant == "integrating" else 1.0)
    rest = load, rng.uniform(20.0, 120.0), rng.uniform(0.0, 0.3)
    return Case(plant, n, *map(float, (*numbers, *rest)), steps)


def simulate(case: Case, rng: np.random.Generator) -> LoopRecord:
    """Return SP, OP and PV of a loop, begun off its rest so that a sticky one cycles."""
    # signals by sample, by run of the controller and by substep
    h = 1.0 / case.substeps
    total = case.n + WARM_UP
    fade = math.exp(-h / case.period)
    kicks = rng.normal(0.0, case.load * math.sqrt(1.0 - fade * fade), total * case.substeps)
    noise = rng.normal(0.0, case.noise, total * case.runs)
    sp = np.full(total, REST)
    for k, size in case.steps:
        sp[WARM_UP + k :] = REST + size
    op, pv = np.empty(total), np.empty(total)

    # the state of controller, stem, load and plant
    out = REST + 0.6 * case.S + 1.0
    force, stem, stuck, load, before, y, error, run = out, REST, True, 0.0, 0.0, 0.0, None, 0
    waiting = [0.0] * (round(case.Td / h) + 1)
    held, passed = (math.exp(-h / T) if T > 0.02 else 0.0 for T in (case.stem, case.T2))
    kept = math.exp(-h / case.T)
    for k in range(total * case.substeps):
        # the controller, several times a sample or once
        if k % (case.substeps // case.runs) == 0:
            seen = REST + y + noise[run]
            seen = case.card * round(seen / case.card) if case.card else seen
            now = sp[k // case.substeps] - seen
            change = now - (now if error is None else error) + now / (case.Ti * case.runs)
            out = min(max(out + case.Kc * change, 0.0), 100.0)
            error = now
            run += 1
            if k % case.substeps == 0:
                op[k // case.substeps], pv[k // case.substeps] = out, seen

        # a stem that slips where static friction is overcome and rests where the force turns
        last, force = force, held * force + (1.0 - held) * out
        apart = force - stem
        stuck = stuck and abs(apart) <= 0.5 * (case.S + case.J)
        if not stuck:
            goal = force - math.copysign(0.5 * (case.S - case.J), apart)
            moves = (goal - stem) * apart > 0.0
            stem = goal if moves else stem
            turns = abs(force - last) < 1e-9 or (force - last) * apart < 0.0
            stuck = case.S > 0.0 and (turns or not moves)

        # load, dead time and plant
        load = fade * load + kicks[k]
        place = k % len(waiting)
        waiting[place] = stem - REST + load
        late = waiting[(place + 1) % len(waiting)]
        if case.plant == "integrating":
            y += case.K * h * late
        else:
            before = passed * before + (1.0 - passed) * case.K * late
            y = kept * y + (1.0 - kept) * before
    return LoopRecord(op[WARM_UP:], pv[WARM_UP:], 1.0, sp[WARM_UP:])


def loop_file(case: Case, rng: np.random.Generator, stated: float) -> Loop:
    """Return what is known of a loop: its plant a little off, its load as far as `stated`."""
    K, T, T2, Td = (
        x * rng.uniform(1.0 - OFF, 1.0 + OFF) for x in (case.K, case.T, case.T2, case.Td)
    )
    plants: dict[str, dict[str, Any]] = {
        "self-regulating": {"type": "foptd", "K": K, "T": T, "Td": Td},
        "second order": {"type": "tf", "num": [K], "den": [T * T2, T + T2, 1.0], "Td": Td},
        "integrating": {"type": "integrating", "K": K, "Td": Td},
    }
    load = {"type": "coloured", "amplitude": stated * case.load, "period": case.period}
    return Loop.from_table(
        {
            "plant": plants[case.plant],
            "controller": {"type": "PI", "Kc": case.Kc, "Ti": case.Ti},
            "sampling": {"Ts": 1.0},
            "noise": {"std": case.noise},
            "disturbance": [load] if stated else [],
        }
    )


def made(seed: int, i: int, sticky: bool) -> tuple[Case, LoopRecord, Loop]:
    """Return the i-th loop with its record and file: the first drawn whose OP meets no end."""
    rng = np.random.default_rng([seed, i, int(sticky)])
    while True:
        case = draw(rng, i, sticky)
        record = simulate(case, rng)
        if 1.0 < record.op.min() and record.op.max() < 99.0:
            return case, record, loop_file(case, rng, STATED[i // 3 % 3])


def asked(seed: int, i: int, sticky: bool) -> dict[str, Any]:
    """Return what is said of one loop with its file and without it."""
    _, record, loop = made(seed, i, sticky)
    alone = conclude(record)
    found = diagnose(record, loop)
    claimed = alone.verdict == STICTION and (alone.probability or 0.0) >= 0.9
    return {
        "friction": is_friction(found.effect),
        "unknown": found.effect == UNKNOWN,
        "none": found.effect == NONE,
        "claimed": found.conclusion.verdict == STICTION,
        "claimed alone at .9": claimed,
        "lost": claimed and found.conclusion.verdict != STICTION,
    }


def with_nuisance(case: Case, seed: int, i: int, nuisance: str) -> LoopRecord:
    """Return a healthy loop again, under the same load, with a nuisance of a size at random."""
    rng = np.random.default_rng([seed, i, 2])
    step = float(rng.uniform(0.2, 0.8)) * case.noise
    again = np.random.default_rng([seed, i, 3])
    if nuisance == "fast controller":
        return simulate(replace(case, runs=int(rng.integers(2, 6)), substeps=60), again)
    if nuisance == "card":
        # of the transmitter, or the decimals of the archive
        if rng.random() < 0.5:
            return simulate(replace(case, card=step), again)
        unit = 10.0 ** math.floor(math.log10(0.8 * case.noise))
        plain = simulate(case, again)
        return replace(plain, pv=unit * np.round(plain.pv / unit), op=np.round(plain.op, 2))
    # a scan twice or missing, again and again
    plain = simulate(case, again)
    rows = list(range(plain.n))
    for k in range(plain.n - 1, 0, -int(rng.integers(300, 1700))):
        rows[k : k + 1] = [k, k] if rng.random() < 0.5 else []
    return plain.with_signals(lambda x: x[rows])


def paired(seed: int, i: int, nuisance: str) -> bool:
    """Return whether a healthy loop is said to be the same with a nuisance and without it."""
    case, _, loop = made(seed, i, False)
    plain = simulate(case, np.random.default_rng([seed, i, 3]))
    other = with_nuisance(case, seed, i, nuisance)
    return diagnose(plain, loop).effect == diagnose(other, loop).effect


def share(name: str, hits: list[bool]) -> str:
    """Return a share with its interval, as a line."""
    lo, hi = wilson(sum(hits), max(len(hits), 1))
    return f"{name:44s} {sum(hits)} of {len(hits)} ({float(lo):.3f} to {float(hi):.3f})"


def main(arguments: list[str] | None = None) -> None:
    """Print the shares: `python -m results.studies.beside_a_model --seed SEED`."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.beside_a_model", description=__doc__
    )
    parser.add_argument("--seed", type=int, required=True, help="not looked at before")
    parser.add_argument("-n", type=int, default=200, help="sticky loops, and half as many healthy")
    parser.add_argument("--pairs", type=int, default=60, help="loops with each nuisance (60)")
    parser.add_argument("-j", type=int, default=2, help="processes (2)")
    o = parser.parse_args(arguments)
    work: Any = Parallel(n_jobs=o.j)
    print(f"seed {o.seed}")
    for sticky, count in ((True, o.n), (False, o.n // 2)):
        rows = work(delayed(asked)(o.seed, i, sticky) for i in range(count))
        for name in rows[0] if rows else ():
            print(share(f"{'sticky' if sticky else 'healthy'}: {name}", [r[name] for r in rows]))
    for nuisance in NUISANCES:
        same = work(delayed(paired)(o.seed, i, nuisance) for i in range(o.pairs))
        print(share(f"{nuisance}: the same answer", same))


if __name__ == "__main__":
    sys.exit(exit_code(main))
