"""Do loops that are labelled as cycling go on without noise, for three times as long as the label
asks?

The label lets the noise end at one of four moments of the record's last period. Here it ends at
each of them again: whether the loop goes on from one of them is judged, from the record's end alone
is told.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from simbench.bench.execute.settle_group import settled
from simbench.bench.scenario.truth import MIN_REVERSALS, YES, least_swing, simulate_with_truth
from simbench.bench.statistics import rate
from simbench.loop.motion import motion
from simbench.loop.simulate import valve_tail
from simbench.scenarios.grid import load_grid
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

MOST_PERIODS, MOST_SAMPLES = 60, 40_000  # of the motion without noise; a label looks at 20 periods
LEAST = 0.995  # share of the loops that go on
MOMENTS = (0.0, 0.25, 0.5, 0.75)  # of the last period, from the record's end back


def goes_on(loop: Loop, seed: int, period_s: float, moment: float = 0.0) -> bool:
    """Return whether the valve swings in the last third of a long motion whose noise ends so many
    periods before the record.
    """
    period = period_s / loop.sampling.Ts
    samples = min(math.ceil(MOST_PERIODS * period), MOST_SAMPLES)
    tail = valve_tail(loop, seed, samples, loop.sampling.n - round(moment * period))
    bar = least_swing(loop)
    late = motion(tail[-(samples // 3) :], bar / 4)
    return late.reversals >= MIN_REVERSALS and late.swing >= bar


def main(arguments: list[str] | None = None) -> int:
    """Print the share of cycling loops that go on: exit code 1 when it is too small."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.truth_again", description=__doc__
    )
    parser.add_argument("grid", nargs="?", default="chapter")
    parser.add_argument("--loops", type=int, default=2000, help="cycling loops [2000]")
    parser.add_argument("--seed", type=int, required=True, help="of the grid and of its groups")
    asked = parser.parse_args(arguments)
    grid = load_grid(asked.grid, {"seed": asked.seed})
    at_end = somewhere = looked = 0
    for index in map(int, np.random.default_rng(asked.seed).permutation(grid.group_count)):
        for scenario, error in settled(grid.group(index)):
            loop, seed = scenario.loop, scenario.seed
            cycled = simulate_with_truth(loop, seed)[1] if error is None else None
            if looked < asked.loops and cycled is not None and cycled.answer == YES:
                looked += 1
                from_end = goes_on(loop, seed, cycled.period)
                at_end += from_end
                somewhere += from_end or any(
                    goes_on(loop, seed, cycled.period, moment) for moment in MOMENTS[1:]
                )
        if looked == asked.loops:
            break
    share, strict = rate(somewhere, looked), rate(at_end, looked)
    print(
        f"{asked.grid}: {somewhere} of {looked} cycling loops go on where the noise ends at one of"
        f" four moments ({share.value:.4f}, {share.lo:.4f} to {share.hi:.4f}; at least {LEAST}),"
        f" {at_end} at the record's end ({strict.value:.4f}, {strict.lo:.4f} to {strict.hi:.4f})"
    )
    return int(somewhere < LEAST * looked)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
