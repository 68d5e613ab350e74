"""How sharp may the corners of a load be before a sound valve is called sticky?
`python -m results.studies.plant.corners ci plant --seed 120` drives loops with a sound valve by
loads that come ever nearer to what friction does, and counts what is concluded.

An echo repeats what a sticky valve did, up to a multiple of its cycle's frequency. Square and
triangular loads have the period of that valve's motion, and its size at the plant's input or that
of PV on PV. No record shows the valve's position.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from results.studies.plant.echoes import (
    STICKY,
    Asked,
    Member,
    Study,
    as_seen,
    ask_grids,
    draw_members,
    oscillates,
    ranked_loops,
)
from results.studies.plant.real_loops import share
from simbench.bench.scenario.truth import YES, simulate_with_truth
from simbench.detectors.verdict import STICTION
from simbench.gap.stiction.probability import verdict
from simbench.gap.thresholds import LIKELIER
from simbench.loop.simulate import simulate
from simbench.scenarios.expansion import Grid
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

CUTS = (1.7, 2.5, 4.0, 8.0)  # cycle's frequency, above which an echo holds nothing
# exponent of the odd harmonics' fall, and the first one over half the swing
WAVES = {"square": (1, 4.0 / math.pi), "triangular": (2, 8.0 / math.pi**2)}
PLACES = ("input", "output")
_ODD = (1, 3, 5, 7)
_LEAST_SAMPLES = 3.0  # per period of a harmonic


def members(grid: str, count: int, seed: int) -> Iterator[Member]:
    """Yield of so many groups of a grid, drawn by the seed, the sticky loop and its sound ones."""
    return draw_members(STUDY, grid, count, seed)


def _members(grid: Grid, group: int, rng: np.random.Generator) -> list[Member]:
    """Return a sticky loop of a group and the sound ones under each load, those that oscillate;
    nothing where the sticky one does not cycle or has no echo.
    """
    stuck, echoes = ranked_loops(grid, group)
    if not stuck or not echoes:
        return []
    one = stuck[int(rng.integers(len(stuck)))]
    run, cycled = simulate_with_truth(one.loop, one.seed)
    if cycled.answer != YES or not oscillates(run.record):
        return []
    sound = {f"echo up to {cut:g}": with_cut(echoes[0].loop, cut) for cut in CUTS}
    half = {"input": cycled.swing / 2.0, "output": float(np.ptp(run.record.pv)) / 2.0}
    sound |= {
        f"{wave} load at {at}": under_wave(echoes[0].loop, wave, at, half[at], cycled.period)
        for wave in WAVES
        for at in PLACES
    }
    runs = {kind: simulate(loop, echoes[0].seed).record for kind, loop in sound.items()}
    return [
        Member(as_seen(run.record), STICKY),
        *(Member(as_seen(record), kind) for kind, record in runs.items() if oscillates(record)),
    ]


def with_cut(loop: Loop, cut: float) -> Loop:
    """Return a loop under an echo that ends at a multiple of its cycle's frequency."""
    *others, echo = loop.disturbance
    numbers = {**echo.parameters, "kind": "smooth", "cut": cut}
    return _under(loop, [*others, Part(name=echo.name, parameters=numbers)])


def under_wave(loop: Loop, wave: str, at: str, half_swing: float, period: float) -> Loop:
    """Return the loop of an echo under a square or triangular load in its place, whose harmonics
    begin at their corners.
    """
    fall, first = WAVES[wave]
    # sines of a square wave pass zero together, those of a triangular one their maximum
    phase = 0.0 if wave == "square" else math.pi / 2.0
    load = [
        Part(
            name="sine",
            parameters={
                "amplitude": half_swing * first / k**fall,
                "period": period / k,
                "phase": phase,
                "at": at,
            },
        )
        for k in _ODD
        if period / k >= _LEAST_SAMPLES * loop.sampling.Ts
    ]
    return _under(loop, [*loop.disturbance[:-1], *load])


def _under(loop: Loop, load: list[Part]) -> Loop:
    return loop.model_copy(update={"disturbance": tuple(load)})


def as_lines(grid: str, answers: Sequence[Asked]) -> list[str]:
    """Return of how many loops of each kind stiction is claimed, and the highest probability."""
    lines = [f"{grid}: of loops that oscillate stiction is claimed"]
    for kind in dict.fromkeys(a.kind for a in answers):
        here = [a.probability for a in answers if a.kind == kind]
        known = [LIKELIER if p is None else p for p in here]
        claimed = sum(verdict(p) == STICTION for p in known)
        highest = max(known, default=0.0)
        lines.append(f"  {kind}: {share(claimed, len(here))}, probability up to {highest:.2f}")
    return lines


STUDY = Study(
    name="corners",
    about=__doc__,
    of_group=_members,
    as_lines=as_lines,
    unit="group",
    count=40,
    needs="a sticky loop that cycles and an echo",
)


def main(arguments: list[str] | None = None) -> int:
    """Ask of the loops of every grid and print what is concluded."""
    return ask_grids(STUDY, arguments)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
