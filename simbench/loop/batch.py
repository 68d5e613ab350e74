"""Simulate many loops at once: those of one kind side by side in the processor's vector units, each with its own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from detectors.compiled import few
from detectors.errors import ParameterError
from scenarios.spec import Loop
from simbench.loop import abreast, plant, sensor
from simbench.loop.noise import drawn
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.resolve import quiet_setup
from simbench.loop.run import Run, finished_run
from simbench.loop.setup import Parts, Setup, parts_of, plain_setup
from simbench.loop.simulate import simulate

SEEDS = 2**64  # larger seeds take numpy's own way into its generator


@dataclass(eq=False)
class Lane:
    """One loop of a batch: what it is, and where its signals stand.

    Parameters
    ----------
    loop, seed, tail, quiet
        As `simulate` takes them.
    setup : Setup, optional
        Where the loop has loads or effects; a plain one is set up again when its run is asked for.
    run : Run, optional
        Where it was simulated by itself.
    signals : ndarray, shape (3, n + tail), optional
        OP, PV, MV.
    """

    loop: Loop
    seed: int
    tail: int
    quiet: int | None
    setup: Setup | None = None
    run: Run | None = None
    signals: Any = None

    def made(self) -> Run:
        """Return the run."""
        if self.run is None:
            setup = self.setup or plain_setup(self.loop, self.seed, self.tail)
            if setup.noise_std > 0:
                setup.pv_add[: self.quiet] += drawn(self.seed, setup.noise_std, setup.pv_add[: self.quiet].size)
            self.run, self.signals = finished_run(setup, *np.ascontiguousarray(self.signals)), None
        return self.run


class Batch(Sequence):
    """Runs of many loops; each becomes a `Run` when it is asked for.

    Parameters
    ----------
    lanes : list of Lane
        In the order of the loops.
    """

    def __init__(self, lanes: list[Lane]) -> None:
        self._lanes = lanes

    def __len__(self) -> int:
        return len(self._lanes)

    def __getitem__(self, i: Any) -> Any:
        return Batch(self._lanes[i]) if isinstance(i, slice) else self._lanes[i].made()

    def mv(self, i: int) -> np.ndarray:
        """Return the valve position (%) of one run, shape (n + tail,), without making the rest of it."""
        lane = self._lanes[i]
        return lane.signals[2].copy() if lane.run is None else lane.run.mv


def simulate_batch(
    loops: Sequence[Loop], seeds: Sequence[int], *, tails: Sequence[int] | int = 0, quiets: Sequence[int | None] | None = None
) -> Batch:
    """Run many loops from rest.

    Parameters
    ----------
    loops : sequence of Loop, length m
        What to run; any mixture.
    seeds : sequence of int, length m
        Root of every random stream of each run.
    tails : int or sequence of int
        Further samples with set point and disturbances frozen and the noise going on.
    quiets : sequence of (int or None), optional
        First sample without measurement noise, of each run.

    Returns
    -------
    Batch
        A sequence of `Run`: element i has the bits of `simulate(loops[i], seeds[i], tail=tails[i], quiet=quiets[i])`.

    Raises
    ------
    UnknownName, ParameterError
        For a plug-in that does not exist, numbers it does not allow, or an unstable plant; sequences of different length.

    Notes
    -----
    Loops of one kind (controller, valve model, sensor) share a compiled loop in which `detectors.compiled.few()` of them run
    abreast; some hundred at a time are best, more only take memory. Loops whose valve iterates within a sample (friction
    solved exactly) or whose plant is of higher order run one by one. Not for a single loop, nor for one that starts away
    from rest: `simulate`.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    ...     "valve": {"model": "choudhury", "S": 5, "J": 2},
    ...     "sampling": {"Ts": 1, "n": 500},
    ...     "noise": {"std": 0.1}})
    >>> runs = simulate_batch([loop, loop.with_("valve.S", 3.0)], [1, 2])
    >>> bool((runs[1].record.pv == simulate(loop.with_("valve.S", 3.0), 2).record.pv).all())
    True
    """
    m = len(loops)
    tails = [tails] * m if isinstance(tails, int) else list(tails)
    quiets = [None] * m if quiets is None else list(quiets)
    if not len(seeds) == len(tails) == len(quiets) == m:
        raise ParameterError(
            f"simulate_batch: {m} loops, {len(seeds)} seeds, {len(tails)} tails and {len(quiets)} quiets; one of each is needed"
        )
    lanes = [Lane(*given) for given in zip(loops, seeds, tails, quiets)]
    kinds: dict[Any, _Kind] = {}
    for lane in lanes:
        if not (_add_plain(kinds, lane) or _add_any(kinds, lane)):
            lane.run = simulate(lane.loop, lane.seed, tail=lane.tail, quiet=lane.quiet)
    for kind in kinds.values():
        kind.simulate()
    return Batch(lanes)


class _Kind:
    """Loops that run by the same steps, and what differs between them."""

    def __init__(self, parts: Parts, setup: Setup, loaded: bool) -> None:
        modules = tuple(module for module, _ in setup.valves)
        states = (len(module.start(setup.op0, p)) for module, p in setup.valves)
        sensed = 2 if parts.steps["sensor_step"] is sensor.full_step else 1
        self.compiled = abreast.compiled(tuple(sorted(parts.steps.items())), modules, parts.classes, (sensed, *states), loaded)
        self.loaded = loaded
        self.lanes: list[Lane] = []
        # per loop: numbers in the order of the steps' own, then (op0, pv0, noise std, first set point)
        self.numbers: list[tuple[float, ...]] = []
        self.about: list[tuple[float, ...]] = []
        # (A, B, Td, Ts) of plants that are sampled all at once, or the dead times of plants that are sampled already
        self.plants: list[tuple[float, ...]] = []
        self.delays: list[int] = []
        self.points: list[list[tuple[int, float]]] = []

    def simulate(self) -> None:
        """Run all lanes and hand each its signals."""
        numbers, about = np.array(self.numbers).T.copy(), np.array(self.about)
        delays = np.array(self.delays)
        if self.plants:
            numbers[0], numbers[1], numbers[2], delays = plant.first_order(*np.array(self.plants).T)
        lag = delays.astype(np.int64) + 1
        length = np.array([lane.loop.sampling.n + lane.tail for lane in self.lanes])
        quiet = np.array([total if lane.quiet is None else lane.quiet for lane, total in zip(self.lanes, length.tolist())])
        # loops of one length together, and then those of one dead time: one that answers at once makes its neighbours wait
        order = np.lexsort((lag, length))
        width = few()
        order = np.concatenate([order, np.repeat(order[-1], -order.size % width)])
        longest = length[order].reshape(-1, width).max(axis=1)
        places = np.concatenate([[0], np.cumsum(longest * width)])
        signals = np.empty((3, places[-1]))
        loads = self._loads(order, places, longest, width) if self.loaded else np.zeros((3, 0))
        seeds = np.array([self.lanes[i].seed for i in order], dtype=np.uint64)
        self.compiled(
            numbers[:, order], *about[order, :2].T, lag[order], length[order], seeds, about[order, 2], quiet[order], about[order, 3],
            *self._events(order, width), loads, signals,
        )  # fmt: skip
        for g, samples in enumerate(longest.tolist()):
            block = signals[:, places[g] : places[g + 1]].reshape(3, samples, width)
            for c, i in enumerate(order[g * width : (g + 1) * width].tolist()):
                self.lanes[i].signals = block[:, : length[i], c]

    def _events(self, order: np.ndarray, width: int) -> tuple[np.ndarray, ...]:
        """Return sample, lane and value of every change of a set point, group by group, and where each group's begin."""
        found, since = [], [0]
        for first in range(0, order.size, width):
            lanes = order[first : first + width].tolist()
            # a later step of the same sample overrules an earlier one: the sort keeps their order
            found += sorted(((k, c, v) for c, i in enumerate(lanes) for k, v in self.points[i]), key=lambda e: e[0])
            since.append(len(found))
        at, who, value = zip(*found) if found else ((), (), ())
        return np.array(at, dtype=np.int64), np.array(who, dtype=np.int64), np.array(value, dtype=float), np.array(since)

    def _loads(self, order: np.ndarray, places: np.ndarray, longest: np.ndarray, width: int) -> np.ndarray:
        loads = np.zeros((3, places[-1]))
        for g, samples in enumerate(longest.tolist()):
            block = loads[:, places[g] : places[g + 1]].reshape(3, samples, width)
            for c, i in enumerate(order[g * width : (g + 1) * width].tolist()):
                setup = self.lanes[i].setup
                assert setup is not None
                for row, signal in enumerate((setup.load_in, setup.load_out, setup.pv_add)):
                    block[row, : signal.size, c] = signal
        return loads


def _add_plain(kinds: dict, lane: Lane) -> bool:
    """Put a loop without loads, effects and further stages among its like; False when it is none."""
    loop, Ts = lane.loop, lane.loop.sampling.Ts
    part, control, process = loop.valve, loop.controller, loop.plant
    if loop.disturbance or loop.effect or "before" in part.parameters or "behind" in part.parameters:
        return False
    module = VALVES.load(part.name)
    if abreast.iterates(module.step) or not 0 <= lane.seed < SEEDS:
        return False
    p = valve_parameters(module, part.parameters, Ts)
    key = control.type, module
    if key not in kinds:
        setup = plain_setup(loop, lane.seed, lane.tail)
        kinds[key] = _Kind(parts_of(setup), setup, loaded=False)
    kind, op0, pv0, gain = kinds[key], loop.operating_point.op0, loop.pv0, control.sign * control.Kc
    second = op0 if control.Ti is None else gain * Ts / control.Ti
    kind.numbers.append((0.0, 0.0, 0.0, pv0, gain, second, Setup.op_lo, Setup.op_hi, 0.0, 0.0, *p))
    kind.about.append((op0 + 0.0, pv0, loop.noise.std, loop.setpoint.value))
    rate = 0.0 if process.T is None else 1.0 / process.T
    kind.plants.append((-rate, process.K if process.T is None else process.K / process.T, process.Td, Ts))
    n = loop.sampling.n
    steps = [(int(np.ceil(t / Ts - 1e-9)), value) for t, value in sorted(loop.setpoint.steps)]
    kind.points.append([(k, value) for k, value in steps if k < n])
    kind.lanes.append(lane)
    return True


def _add_any(kinds: dict, lane: Lane) -> bool:
    """Put a loop among its like as it is once its loads and effects stand; False when it must run by itself."""
    setup = quiet_setup(lane.loop, lane.seed, lane.tail)
    if len(setup.den) != 2 or not 0 <= lane.seed < SEEDS or any(abreast.iterates(m.step) for m, _ in setup.valves):
        return False
    parts = parts_of(setup)
    loaded = any(signal.any() for signal in (setup.load_in, setup.load_out, setup.pv_add))
    key = tuple(sorted(parts.steps.items())), tuple(m for m, _ in setup.valves), parts.classes, loaded
    if key not in kinds:
        kinds[key] = _Kind(parts, setup, loaded)
    kind, (*fixed, stages) = kinds[key], parts.bare
    kind.numbers.append(tuple(x for numbers in (*fixed, *stages) for x in numbers))
    kind.about.append((setup.op0 + 0.0, setup.pv0, setup.noise_std, setup.sp[0]))
    kind.delays.append(parts.sampled.delay)
    changes = np.flatnonzero(np.diff(setup.sp)) + 1
    kind.points.append(list(zip(changes.tolist(), setup.sp[changes].tolist())))
    kind.lanes.append(lane)
    lane.setup = setup
    return True
