"""A setup run sample by sample: the record, and behind it what no plant shows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.loop import kernel, sensor
from simbench.loop.linear import Parts, control_start, in_series, parts_of, plant_start
from simbench.loop.setup import MV_NOISE, Setup

if TYPE_CHECKING:
    import pandas as pd

    from simbench.scenarios.parts import Archiving


@dataclass(frozen=True)
class Start:
    """Where a run begins, when not in equilibrium."""

    op: float  # OP (%) one sample before the run; a PI controller goes on from it
    error: float  # SP - PV (PV units) at that sample
    # PV (PV units) at sample 0 before noise and output load; of first-order and integrating plants
    pv: float
    # state of the (one) valve model at that sample, as its `step` takes it
    valve: tuple[float, ...]
    # the last MVs (%), oldest first, as many as dead time + 1 sample need; the first fills what is
    # missing
    mv: tuple[float, ...]
    # state of a plant of higher order at sample 0; `pv` says it where there is none
    state: tuple[float, ...] = ()
    # state of a PID one sample before the run; `op` and `error` say it where there is none
    control: tuple[float, ...] = ()


class WholeRun(NamedTuple):
    """A run before a record was cut from it and archived: its setup, OP and PV as measured, from
    the start of the warm-up to the record's end.
    """

    setup: Setup
    op: np.ndarray
    pv: np.ndarray


@dataclass(frozen=True, eq=False)
class Run:
    """What a simulation knows: the record, and behind it what no plant shows.

    Parameters
    ----------
    record : LoopRecord
        SP, OP, PV as archived, MV; n samples.
    load_in, load_out : ndarray, shape (n + tail,)
        Loads at the plant's input (%) and output (PV units).
    tail : LoopRecord or None
        The continued run after the record, with set point and disturbances frozen.
    sticky : bool
        Whether the valve has friction.
    mv : ndarray, shape (n + tail,)
        Valve position (%) as it is; the record's may carry noise.
    friction : (float, float)
        Mapped S and J (% of travel) of the stickiest stage of the valve.
    notes : tuple of str
        What the reader must know of how it was computed.
    outer : LoopRecord or None
        What was recorded of the outer loop, where the loop is the inner one of a cascade.
    whole : WholeRun or None
        The run before it was archived; it stays in the process in which it was simulated.
    """

    record: LoopRecord
    load_in: np.ndarray
    load_out: np.ndarray
    tail: LoopRecord | None
    sticky: bool
    mv: np.ndarray
    friction: tuple[float, float] = (0.0, 0.0)
    notes: tuple[str, ...] = ()
    outer: LoopRecord | None = None
    whole: WholeRun | None = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        # a setup holds kernels and plug-ins, which do not travel
        return {**self.__dict__, "whole": None}

    def to_frame(self) -> pd.DataFrame:
        """Return the record as a table.

        Returns
        -------
        DataFrame
            t_s, sp, op, pv, mv.
        """
        return self.record.to_frame()

    def plot(self, **options: Any) -> Any:
        """Draw the record, see `LoopRecord.plot`.

        Parameters
        ----------
        **options
            As `pandas.DataFrame.plot` takes them.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (2,)
            PV with SP above, OP with MV below.
        """
        return self.record.plot(**options)

    def _repr_html_(self) -> str:
        return self.record._repr_html_()


def run_setup(
    setup: Setup, *, kick: float = 0.0, start: Start | None = None, plain: bool = False
) -> Run:
    """Run a resolved loop, compiled or (`plain`) in Python sample by sample; both give the same
    bits.
    """
    return finished_run(setup, *signals_of(setup, kick=kick, start=start, plain=plain))


def signals_of(
    setup: Setup, *, kick: float = 0.0, start: Start | None = None, plain: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return OP, PV as the controller saw it, and MV of a run, each of shape (warm_up + n +
    tail,).
    """
    # The steps of each part
    parts = parts_of(setup)
    sampled = parts.sampled
    total = setup.sp.size

    # The master of a cascade, and the lags of both plants
    if setup.outer is None:
        outer = None
    else:
        outer = in_series(setup, setup.outer)
    lags = (sampled.delay + 1, 0 if outer is None else outer.sampled.delay + 1)

    # The state at rest
    w = np.zeros(total + max(lags))
    pv = setup.pv0
    c = control_start(setup, parts.numbers[1])
    v = []
    u = setup.op0
    for module, p in setup.valves:
        state = tuple(float(x) for x in module.start(u, p))
        v.append(state)
        u = state[0]

    # Or that of a cycle
    if start is not None:
        past = np.array(start.mv[-(sampled.delay + 1) :], dtype=float) - setup.op0
        w[: sampled.delay + 1] = past[0]
        w[sampled.delay + 1 - past.size : sampled.delay + 1] = past
        pv = start.pv
        c = start.control or (float(start.op), float(start.error))
        v = [tuple(float(x) for x in start.valve)]

    # Plant and sensor start with it
    x = plant_start(setup, parts, pv, () if start is None else start.state)
    if setup.frozen is not None:
        s: Any = sensor.freezing_start(pv)
    else:
        if parts.steps["sensor_step"] is sensor.full_step:
            s = sensor.full_start(pv)
        else:
            s = sensor.plain_start(pv)

    # Room for the signals, and OP's first move
    op = np.empty(total)
    measured = np.empty(total)
    mv = np.empty(total)
    moves = setup.op_moves.copy()
    moves[0] += kick

    # A cascade has a kernel of its own
    outside = [f for f in (setup.plant_plugin, setup.control_plugin) if f is not None]
    if outer is not None:
        return _run_cascade(
            setup, parts, outer, lags, moves, plain, (w, x, c, tuple(v), s, op, measured, mv)
        )

    # Plain Python, plug-ins that may not compile, or compiled
    if plain:
        make = kernel.bind
    elif outside:
        make = kernel.compiled_where_possible
    else:
        make = kernel.compiled
    make(parts.steps, parts.stages, parts.classes)(
        setup.sp,
        setup.load_in,
        setup.load_out,
        setup.pv_add,
        moves,
        setup.op0,
        w,
        x,
        c,
        tuple(v),
        s,
        parts.bare,
        op,
        measured,
        mv,
    )
    return op, measured, mv


def as_archived(
    op: np.ndarray, pv: np.ndarray, archive: Archiving
) -> tuple[np.ndarray, np.ndarray]:
    """Return OP and PV as an archive keeps them: in its steps, and its last value repeated where it
    did so.
    """
    return (
        _archive_signal(op, archive.op_step, archive.op_held),
        _archive_signal(pv, archive.pv_step, archive.pv_held),
    )


def _archive_signal(x: np.ndarray, step: float, held: tuple[int, ...] | None) -> np.ndarray:
    """Return a signal in steps, repeating its last value where `held` is 1."""
    if step > 0.0:
        x = step * np.round(x / step)
    if not held:
        return x
    rests = np.resize(np.array(held, dtype=bool), x.size)
    return x[np.maximum.accumulate(np.where(rests, 0, np.arange(x.size)))]


def _run_cascade(
    setup: Setup,
    parts: Parts,
    outer: Parts,
    lags: tuple[int, int],
    moves: np.ndarray,
    plain: bool,
    rooms: tuple,
) -> tuple:
    """Run both loops of a cascade; the inner set point stands in `setup.sp` afterwards, the outer
    OP and PV beside it.
    """
    # The master's limits, and its steps by their names in the kernel
    assert setup.outer is not None
    assert setup.loop.outer is not None
    w, x, c, v, s, op, measured, mv = rooms
    master = setup.outer
    lo, hi = setup.loop.outer.sp_span
    steps = {
        "outer_plant_step": "plant_step",
        "outer_plant_output": "plant_output",
        "outer_step": "controller_step",
    }
    steps = parts.steps | {name: outer.steps[own] for name, own in steps.items()}

    # The numbers of both loops
    plant_p, control_p, gap_p, sensor_p, valve_p = parts.numbers
    both = replace(
        parts,
        steps=steps,
        numbers=(plant_p, control_p, gap_p, sensor_p) + outer.numbers[:2] + (valve_p,),
    )

    # The master at rest
    X = plant_start(master, outer, master.pv0)
    C = control_start(master, outer.numbers[1])
    signals = np.empty_like(op), np.empty_like(op)
    (kernel.bind if plain else kernel.compiled)(both.steps, both.stages, both.classes)(
        master.sp,
        master.pv_add,
        float(lo),
        float(hi - lo) / 100.0,
        setup.sp,
        setup.load_in,
        setup.load_out,
        setup.pv_add,
        moves,
        setup.op0,
        lags,
        w,
        x,
        c,
        v,
        s,
        X,
        C,
        both.bare,
        op,
        measured,
        mv,
        *signals,
    )

    # What the kernel filled
    setup.outer_signals = signals
    return op, measured, mv


def finished_run(setup: Setup, op: np.ndarray, measured: np.ndarray, mv: np.ndarray) -> Run:
    """Return the run that gave these signals, each of shape (warm_up + n + tail,); PV and MV are
    recorded as the setup says.
    """
    first = setup.warm_up
    end = setup.end
    archived = measured
    for recorder in setup.recorders:
        archived = recorder(archived)
    process = "integrating" if setup.integrating else "self-regulating"
    recorded = mv
    mv_std = setup.loop.noise.mv_std or 0.0
    if mv_std > 0:
        recorded = mv + mv_std * np.random.default_rng([setup.seed, MV_NOISE]).standard_normal(
            mv.size
        )

    def part(cut: slice, kept: Archiving | None = None) -> LoopRecord:
        # What the archive keeps of both
        signals = op[cut], archived[cut]
        if kept is None:
            kept_op, kept_pv = signals
        else:
            kept_op, kept_pv = as_archived(*signals, kept)

        # The record of that part
        return LoopRecord(
            op=kept_op,
            pv=kept_pv,
            sp=setup.sp[cut],
            mv=recorded[cut],
            Ts=setup.Ts,
            process=process,
            op_span=(0.0, 100.0),
        )

    if setup.tail >= 3:
        tail = part(slice(end, None))
    else:
        tail = None
    notes = []
    for found in (setup.plant_plugin, setup.control_plugin):
        if found:
            notes += filter(None, [kernel.runs_plainly(found[0].step)])
    loads = setup.load_in[first:], setup.load_out[first:]
    run = Run(
        part(slice(first, end), setup.loop.archive),
        *loads,
        tail,
        setup.sticky,
        mv[first:],
        setup.friction,
        tuple(notes),
        whole=WholeRun(setup, op[:end], archived[:end]),
    )
    if setup.outer is None or setup.outer_signals is None:
        return run
    master = "integrating" if setup.outer.integrating else "self-regulating"
    op_, pv_, sp_ = (signal[first:end] for signal in setup.outer_signals + (setup.outer.sp,))
    outer = LoopRecord(op=op_, pv=pv_, sp=sp_, Ts=setup.Ts, process=master, op_span=(0.0, 100.0))
    return replace(run, outer=outer)
