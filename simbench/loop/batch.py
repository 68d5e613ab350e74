"""Simulate many loops at once: those of one kind side by side in the processor's vector units, each with its own numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import ceil
from typing import Any

import numpy as np

from detectors.compiled import compiled, few
from detectors.errors import ParameterError
from scenarios.spec import Loop
from simbench.loop import abreast, plant, sensor
from simbench.loop.noise import draw
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.resolve import quiet_setup
from simbench.loop.run import finished_run, signals_of
from simbench.loop.setup import Parts, Setup, parts_of, plain_setup

ABOUT = 6  # numbers of a loop's row before those of its steps
SEEDS = 2**64  # larger seeds take numpy's own way into its generator


@dataclass(eq=False, slots=True)
class Lane:
    """One loop of a batch: what it is, and where its signals stand."""

    # loop, seed: as `simulate` takes them
    loop: Loop
    seed: int
    setup: Setup | None = None  # where the loop has loads or effects; a plain one is set up again when its run is asked for
    room: Any = None  # (3, n or more, lanes) OP, PV, MV of the loops that ran abreast
    column: int = 0  # which of them this loop is

    @property
    def signals(self) -> np.ndarray:
        """OP, PV, MV, shape (3, warm_up + n), a view."""
        return self.room[:, : (self.loop.sampling.warm_up or 0) + self.loop.sampling.n, self.column]


class Batch(Sequence):
    """Runs of many loops; each becomes a `Run` when it is asked for."""

    def __init__(self, lanes: list[Lane]) -> None:
        self._lanes = lanes

    def __len__(self) -> int:
        return len(self._lanes)

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return Batch(self._lanes[i])
        lane = self._lanes[i]
        setup = lane.setup or plain_setup(lane.loop, lane.seed)
        op, pv, mv = lane.signals
        return finished_run(setup, op, pv, mv.copy())

    def signals(self, i: int) -> np.ndarray:
        """Return OP (%), PV as the controller saw it and MV (%) of one run, shape (3, n), a view."""
        lane = self._lanes[i]
        return lane.signals[:, lane.loop.sampling.warm_up or 0 :]


def simulate_batch(loops: Sequence[Loop], seeds: Sequence[int]) -> Batch:
    """Run many loops from rest.

    Parameters
    ----------
    loops : sequence of Loop, length m
        What to run; any mixture.
    seeds : sequence of int, length m
        Root of every random stream of each run.

    Returns
    -------
    Batch
        A sequence of `Run`: element i has the bits of `simulate(loops[i], seeds[i])`.

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
    >>> from simbench.loop.simulate import simulate
    >>> bool((runs[1].record.pv == simulate(loop.with_("valve.S", 3.0), 2).record.pv).all())
    True
    """
    if len(seeds) != len(loops):
        raise ParameterError(f"simulate_batch: {len(loops)} loops and {len(seeds)} seeds; one of each is needed")
    lanes = [Lane(loop, seed) for loop, seed in zip(loops, seeds)]
    kinds: dict[Any, _Kind] = {}
    for lane in lanes:
        if not _add_plain(kinds, lane):
            _add_any(kinds, lane)
    for kind in kinds.values():
        kind.simulate()
    return Batch(lanes)


class _Kind:
    """Loops that run by the same steps, and what differs between them."""

    def __init__(self, parts: Parts, setup: Setup, *, loaded: bool, sampled: bool) -> None:
        modules = tuple(module for module, _ in setup.valves)
        states = (len(module.start(setup.op0, p)) for module, p in setup.valves)
        sensed = 2 if parts.steps["sensor_step"] is sensor.full_step else 1
        self.run = abreast.compiled(tuple(sorted(parts.steps.items())), modules, parts.classes, (sensed, *states), loaded)
        self.loaded, self.sampled = loaded, sampled
        self.draw = compiled(draw)
        self.lanes: list[Lane] = []
        # one loop's behind the other's: op0, pv0, noise std, first set point, samples, the plant's dead time in samples, then
        # numbers in the order of the steps' own. A plant not yet sampled has Ts for its dead time and A, B, Td for its numbers
        self.rows: list[float] = []
        # sample, loop, value of every change of a set point
        self.points: list[float] = []

    def simulate(self) -> None:
        """Run all lanes and hand each its signals."""
        m = len(self.lanes)
        rows = np.array(self.rows).reshape(m, -1).T.copy()
        (op0, pv0, std, sp0, samples, delay), numbers = rows[:ABOUT], rows[ABOUT:]
        if not self.sampled:
            numbers[0], numbers[1], numbers[2], delay = plant.first_order(*numbers[:3], delay)
        lag, length = delay.astype(np.int64) + 1, samples.astype(np.int64)
        # loops of one length together, and then those of one dead time: one that answers at once makes its neighbours wait
        order = np.lexsort((lag, length))
        width = few()
        order = np.concatenate([order, np.repeat(order[-1], -order.size % width)])
        seeds = np.array([lane.seed for lane in self.lanes], dtype=np.uint64)
        longest = int(length[order[-1]])
        # in one piece, which a computer hands out faster than many
        starts = np.concatenate([[0], np.cumsum(3 * width * length[order[width - 1 :: width]])])
        room = np.empty(starts[-1])
        added, w = np.empty((longest, width)), np.empty((longest + lag.max()) * width)
        for group, (start, events) in enumerate(zip(starts.tolist(), self._events(order[:m], width))):
            some = order[group * width : (group + 1) * width]
            n = int(length[some[-1]])
            now, signals = added[:n], room[start : start + 3 * n * width].reshape(3, n, width)
            loads = self._loads(some, now)
            self.draw(seeds[some], std[some], length[some], now)
            self.run(
                numbers[:, some], op0[some], pv0[some], lag[some], sp0[some], *events, loads, now.ravel(), w,
                signals.reshape(3, -1),
            )  # fmt: skip
            for c, i in enumerate(some.tolist()[: m - group * width]):
                lane = self.lanes[i]
                lane.room, lane.column = signals, c

    def _events(self, order: np.ndarray, width: int) -> Iterator[tuple[np.ndarray, ...]]:
        """Yield sample, lane and value of every change of a set point, group by group."""
        at, loop, value = np.array(self.points, dtype=float).reshape(-1, 3).T
        place = np.empty(len(self.lanes), dtype=np.int64)
        place[order] = np.arange(order.size)
        group, lane = np.divmod(place[loop.astype(np.int64)], width)
        # a later step of the same sample overrules an earlier one: the sort keeps their order
        sort = np.lexsort((at, group))
        since = np.searchsorted(group[sort], np.arange(1, -(-order.size // width)))
        yield from zip(*(np.split(x[sort], since) for x in (at.astype(np.int64), lane, value)))

    def _loads(self, some: np.ndarray, added: np.ndarray) -> np.ndarray:
        """Return the loads of a group of loops as the kernel takes them; set `added` to what the sensor adds but for noise."""
        added[:] = 0.0
        if not self.loaded:
            return np.zeros((2, 0))
        loads = np.zeros((2, *added.shape))
        for c, i in enumerate(some.tolist()):
            setup = self.lanes[i].setup
            assert setup is not None
            for room, signal in ((loads[0], setup.load_in), (loads[1], setup.load_out), (added, setup.pv_add)):
                room[: signal.size, c] = signal
        return loads.reshape(2, -1)


def _add_plain(kinds: dict, lane: Lane) -> bool:
    """Put a loop without loads, effects and further stages among its like; False when it is none."""
    loop, Ts = lane.loop, lane.loop.sampling.Ts
    part, control, process = loop.valve, loop.controller, loop.plant
    odd = control.type not in ("P", "PI") or process.parameters is not None or len(process.den or ()) > 2
    odd = odd or bool(loop.outer or loop.disturbance or loop.effect)
    if odd or "before" in part.parameters or "behind" in part.parameters:
        return False
    module = VALVES.load(part.name)
    if abreast.iterates(module.step) or not 0 <= lane.seed < SEEDS:
        return False
    p = valve_parameters(module, part.parameters, Ts)
    key = control.type, module
    if key not in kinds:
        setup = plain_setup(loop, lane.seed)
        kinds[key] = _Kind(parts_of(setup), setup, loaded=False, sampled=False)
    kind, op0, pv0, gain = kinds[key], loop.operating_point.op0, loop.pv0, control.sign * control.Kc
    second = op0 if control.Ti is None else gain * Ts / control.Ti
    rate, push = (0.0, process.K) if process.T is None else (1.0 / process.T, process.K / process.T)
    n, setpoint = (loop.sampling.warm_up or 0) + loop.sampling.n, loop.setpoint
    kind.rows += (
        op0 + 0.0, pv0, loop.noise.std, setpoint.value, n, Ts,
        -rate, push, process.Td, pv0, gain, second, Setup.op_lo, Setup.op_hi, 0.0, 0.0, *p,
    )  # fmt: skip
    for t, value in sorted(setpoint.steps):
        k = ceil(t / Ts - 1e-9)
        if k < n:
            kind.points += (k, len(kind.lanes), value)
    kind.lanes.append(lane)
    return True


def _add_any(kinds: dict, lane: Lane) -> None:
    """Put a loop among its like as it is once its loads and effects stand, or run it by itself."""
    lane.setup = setup = quiet_setup(lane.loop, lane.seed)
    odd = setup.outer is not None or setup.plant_plugin is not None or setup.loop.controller.type not in ("P", "PI")
    odd = odd or len(setup.den) != 2 or any(abreast.iterates(m.step) for m, _ in setup.valves)
    odd = odd or setup.controller_law is not None or setup.sensor_law is not None
    if odd or not 0 <= lane.seed < SEEDS:
        setup.draw_noise()
        lane.room = np.array(signals_of(setup))[..., None]
        return
    parts = parts_of(setup)
    loaded = any(signal.any() for signal in (setup.load_in, setup.load_out, setup.pv_add))
    key = tuple(sorted(parts.steps.items())), tuple(m for m, _ in setup.valves), parts.classes, loaded
    if key not in kinds:
        kinds[key] = _Kind(parts, setup, loaded=loaded, sampled=True)
    kind, (*fixed, stages) = kinds[key], parts.bare
    kind.rows += (setup.op0 + 0.0, setup.pv0, setup.noise_std, setup.sp[0], setup.end, parts.sampled.delay)
    kind.rows += chain.from_iterable((*fixed, *stages))
    for k in (np.flatnonzero(np.diff(setup.sp)) + 1).tolist():
        kind.points += (k, len(kind.lanes), setup.sp[k])
    kind.lanes.append(lane)
