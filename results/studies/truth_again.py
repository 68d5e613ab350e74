"""Do loops that are labelled as cycling go on without noise, for three times as long as the label
asks?
"""

from __future__ import annotations

import argparse
import math

from simbench.bench.execute.settle_group import settled
from simbench.bench.scenario.truth import MIN_REVERSALS, YES, least_swing, simulate_with_truth
from simbench.loop.motion import motion
from simbench.loop.simulate import valve_tail
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

MOST_PERIODS, MOST_SAMPLES = 60, 40_000  # of the motion without noise; a label looks at 20 periods
LEAST = 0.995  # share of the loops that go on
STEP = 7  # groups between two that are looked at


def goes_on(loop, seed: int, period_s: float) -> bool:
    """Return whether the valve swings in the last third of a long motion whose noise ends with the
    record.
    """
    samples = min(math.ceil(MOST_PERIODS * period_s / loop.sampling.Ts), MOST_SAMPLES)
    tail = valve_tail(loop, seed, samples, loop.sampling.n)
    bar = least_swing(loop)
    late = motion(tail[-(samples // 3) :], bar / 4)
    return late.reversals >= MIN_REVERSALS and late.swing >= bar


def main(arguments: list[str] | None = None) -> int:
    """Print the share of cycling loops that go on: exit code 1 when it is too small."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.truth_again", description=__doc__
    )
    parser.add_argument("grid", nargs="?", default="chapter")
    parser.add_argument("--loops", type=int, default=300, help="number of cycling loops")
    parser.add_argument("--seed", type=int, help="seed in place of that of the grid")
    asked = parser.parse_args(arguments)
    grid = load_grid(asked.grid, {} if asked.seed is None else {"seed": asked.seed})
    on = looked = 0
    for index in (i * STEP % grid.group_count for i in range(grid.group_count)):
        for scenario, error in settled(grid.group(index)):
            cycled = simulate_with_truth(scenario.loop, scenario.seed)[1] if error is None else None
            if looked < asked.loops and cycled is not None and cycled.answer == YES:
                looked += 1
                on += goes_on(scenario.loop, scenario.seed, cycled.period)
        if looked == asked.loops:
            break
    print(
        f"{asked.grid}: {on} of {looked} cycling loops go on without noise"
        f" ({on / max(looked, 1):.3f}; at least {LEAST})"
    )
    return int(on < LEAST * looked)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
