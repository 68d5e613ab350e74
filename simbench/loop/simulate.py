"""Simulate one closed loop: a pure function of the loop and the seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import Run, Start, run_setup, signals_of
from simbench.scenarios.spec import Loop


def simulate(
    loop: Loop,
    seed: int = 0,
    *,
    kick: float = 0.0,
    tail: int = 0,
    start: Start | None = None,
    plant: Any = None,
    quiet: int | None = None,
) -> Run:
    """Run a closed loop from rest.

    Parameters
    ----------
    loop : Loop
        The loop file's content.
    seed : int
        Root of every random stream; the same loop and seed give the same bits.
    kick : float
        Offset (%) of OP at sample 0; a PI controller keeps it as its integral, a P controller
        forgets it.
    tail : int
        Further samples with set point and disturbances frozen and the noise going on.
    start : Start, optional
        Begin elsewhere than in equilibrium.
    plant : control.TransferFunction, optional
        Any stable or integrating SISO plant in place of the loop's own; `loop.plant.Td` stays its
        dead time.
    quiet : int, optional
        First sample of the record without measurement noise.

    Returns
    -------
    Run
        Signals of shape (n,) and what is true of the loop; `record` is what a plant would
        have recorded.

    Raises
    ------
    UnknownName, ParameterError
        For a plug-in that does not exist, numbers it does not allow, or an unstable plant.

    Notes
    -----
    Order within a sample: PV is measured with its noise, OP is computed, the valve moves and stays
    until the next sample. Not for plants with direct feedthrough, whose PV would answer within the
    same sample.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    ...     "valve": {"model": "choudhury", "S": 5, "J": 2},
    ...     "sampling": {"Ts": 1, "n": 2000},
    ...     "setpoint": {"value": 50, "steps": [[10, 55]]}})
    >>> mv = simulate(loop).record.mv[-200:]
    >>> bool(mv.max() - mv.min() > 1.5)
    True
    """
    setup = resolve_loop(loop, seed, tail, plant, quiet)
    return run_setup(setup, kick=kick, start=start)


def simulate_batch(loops: Sequence[Loop], seeds: Sequence[int]) -> list[Run]:
    """Run many closed loops from rest, one after the other.

    Parameters
    ----------
    loops : sequence of Loop, length m
        The loops to run; any mixture.
    seeds : sequence of int, length m
        Root of every random stream of each run.

    Returns
    -------
    list of Run, length m
        Element i equals `simulate(loops[i], seeds[i])`.

    Raises
    ------
    UnknownName, ParameterError
        As `simulate`; also for sequences of different length.

    Notes
    -----
    Not for grids of scenarios with detectors: `run` works those in parallel and can be resumed.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    ...     "sampling": {"Ts": 1, "n": 500},
    ...     "noise": {"std": 0.1}})
    >>> [run.record.n for run in simulate_batch([loop, loop.with_("sampling.n", 70)], [1, 2])]
    [500, 70]
    """
    if len(seeds) != len(loops):
        message = (
            f"simulate_batch: {len(loops)} loops and {len(seeds)} seeds; one of each is needed"
        )
        raise ParameterError(message)
    return [simulate(loop, seed) for loop, seed in zip(loops, seeds)]


def valve_tail(loop: Loop, seed: int, tail: int, quiet: int | None) -> np.ndarray:
    """Return the valve's positions (%) behind the record, `simulate(...).mv[n:]`, without making a
    record of the rest.
    """
    setup = resolve_loop(loop, seed, tail, None, quiet)
    return signals_of(setup)[2][setup.end :]
