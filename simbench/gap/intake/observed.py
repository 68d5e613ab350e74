"""Examine a record and its baseline as they came: signals, controller law and what the baseline
states.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.quality import inspect
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import holds, runs_of
from simbench.detectors.signal.lattice import lattice, root_lattice, written_unit
from simbench.gap.controller.examine import examine_controller
from simbench.gap.controller.law import Law
from simbench.gap.controller.pi_law import LAW_ROWS
from simbench.gap.likelihood.model import Data, before_filter
from simbench.gap.sensor.samples import Samples
from simbench.gap.situation import Seen, coloured_on_pv, through_valve
from simbench.loop.plant import beyond_first_order, first_order_like, polynomials
from simbench.scenarios.spec import Loop

_STUCK = 0.01  # share of samples in standstills that noise and rounding do not bring
_STEPS = 0.1  # share of samples; a set point that moves more often is another controller's output


def op_in_percent(r: LoopRecord, compared: bool, where: str) -> np.ndarray:
    """Return OP in %; as recorded where its scale is not known and nothing is `compared`."""
    if r.op_percent is None and compared:
        raise RecordError(
            f"{where}: OP runs from {r.op.min():g} to {r.op.max():g}, which is not % of"
            " travel; give --op-span, the values that mean 0 and 100 %"
        )
    return r.op if r.op_percent is None else r.op_percent


def stated_noise(baseline: Loop, Ts: float) -> float:
    """Return the standard deviation of PV's noise as the baseline states it, coloured noise on PV
    counted in, behind the filter that it states.
    """
    coloured = [load["amplitude"] for load in coloured_on_pv(baseline, Ts, slow=False)]
    return float(
        np.linalg.norm([baseline.noise.std] + coloured) * _share_through_filter(baseline, Ts)
    )


def _filter_of(baseline: Loop, Ts: float) -> float:
    """Return the time constant (samples) of the stated filter of PV, 0 where there is none."""
    tau = sum(float(p.parameters["tau"]) for p in baseline.effect if p.name == "sensor_lag")
    return tau / Ts


def _share_through_filter(baseline: Loop, Ts: float) -> float:
    """Return the share of the standard deviation of white noise that passes the stated filter."""
    tau = _filter_of(baseline, Ts)
    if tau > 0.0:
        return float(np.sqrt(np.tanh(0.5 / tau)))
    return 1.0


def before_sensor(
    baseline: Loop, Ts: float, pv: np.ndarray, resolution: float
) -> tuple[np.ndarray, float]:
    """Return PV (n,) before the filter that the baseline states, where noise is white, and the step
    of the digits of the PV behind it, as they count there.
    """
    y = np.ascontiguousarray(pv, dtype=float)
    tau = _filter_of(baseline, Ts)
    if tau == 0.0:
        return y, resolution
    keep = float(np.exp(-1.0 / tau))
    return before_filter(y, tau), resolution * float(np.hypot(1.0, keep)) / (1.0 - keep)


def _stated_loads(baseline: Loop, kind: str, at: str) -> list[dict[str, Any]]:
    """Return the loads of a kind that the baseline states at the plant's input or output."""
    loads = [part.parameters for part in baseline.disturbance if part.name == kind]
    stated = []
    for p in loads:
        if p.get("at", "input") == at:
            stated.append(p)
    return stated


def law_of(r: LoopRecord, op: np.ndarray, baseline: Loop, tuned: bool, noise: float) -> Law:
    """Return what turned the error into OP; in manual OP is an input and no law is asked."""
    manual = r.meta.get("manual")
    if manual is None or not np.any(manual):
        return examine_controller(op, r.pv, r.sp, r.Ts, baseline, tuned, noise)
    law = law_in_automatic(r, op, ~np.asarray(manual), baseline, tuned, noise)
    if law is None:
        control = baseline.controller
        return Law(0.0, control.sign * control.Kc, control.Ti or np.inf)
    return replace(law, recovered_pv=None, averaged=False, reason="")


def law_in_automatic(
    r: LoopRecord, op: np.ndarray, automatic: np.ndarray, baseline: Loop, tuned: bool, noise: float
) -> Law | None:
    """Return the law of the longest stretch in automatic; None where it is too short to show."""
    rows = longest_run(automatic)
    if rows.stop - rows.start < LAW_ROWS or np.ptp(op[rows]) == 0.0:
        return None
    if r.sp is None:
        sp = None
    else:
        sp = r.sp[rows]
    return examine_controller(op[rows], r.pv[rows], sp, r.Ts, baseline, tuned, noise)


def is_frozen(r: LoopRecord, op: np.ndarray, samples: Samples, noise: float) -> bool:
    """Return whether PV rests while OP moves, longer than an archive that reports by exception has
    it; without noise it rests for the dead time alone.
    """
    if noise > 0.0 and samples.stuck > _STUCK:
        return True
    # a loop without noise comes to rest as a whole: the moves of OP within one standstill count
    lengths = holds(r.pv)
    moves = np.bincount(np.repeat(np.arange(lengths.size), lengths), moving(op))
    return samples.band == 0.0 and moves.max() > max(20, 0.02 * r.n)


def notes_of(seen: Seen) -> list[str]:
    """Return what the reader must know: data quality, the set point, a controller that is not
    known, or faster than the archive.
    """
    r = seen.record
    law = seen.law
    notes = [f"data quality: {flag.name}: {flag.evidence}" for flag in inspect(r).values()]
    if r.sp is None:
        notes.append("no set point recorded: the mean of PV stands for it")
    else:
        notes += moves_of(r.sp)
    if law.reason and not law.apart:
        notes.append(f"controller: cannot tell, {law.reason}")
    return notes


def remarks_of(r: LoopRecord, samples: Samples, integrating: bool) -> list[str]:
    """Return what an identified loop takes from its record, and what no effect of it can say:
    the plant's type, lattices, wild samples.
    """
    # The type of process, where nobody stated it
    pv = np.asarray(r.pv)
    op = np.asarray(r.op)
    out = []
    if r.process is None:
        kind = "integrating" if integrating else "self-regulating"
        if r.kind:
            said = f", and a {r.kind} may be either"
        else:
            said = ""
        out.append(f"process: not given{said}; judged as {kind}, the likelier of the two")

    # Signals on a lattice
    for signal, x, other in (("PV", pv, op), ("OP", op, pv)):
        step = lattice(x, written_unit(x, other)) or root_lattice(x)
        if step > 0.0:
            share = f"{step / float(x.std()):.1%} of the standard deviation"
            levels = f"{np.unique(x).size} levels, {step:.3g} apart ({share})"
            out.append(f"lattice: {x.size} samples of {signal} on {levels}")

    # Isolated outliers
    if samples.spikes.size:
        first = f"the first {samples.spikes[0] * r.Ts:g} s after the start"
        out.append(f"outliers: {samples.spikes.size} isolated, {first}")
    return out


def moves_of(sp: np.ndarray) -> list[str]:
    """Return how often SP moves, and by how much at most, unless it is another controller's OP."""
    moves = np.abs(np.diff(sp))
    count = int(np.count_nonzero(moves))
    if not 0 < count < _STEPS * sp.size:
        return []
    return [
        f"set-point steps: SP moves in {count} step{'s' * (count > 1)}, the largest"
        f" {float(moves.max()):.3g}"
    ]


def data_of(seen: Seen, plant_pv: np.ndarray, resolution: float) -> Data:
    """Return the engine's input, with PV as the plant gave it to the controller, and the lattice on
    which it was put there.
    """
    r = seen.record
    baseline = seen.baseline
    plant = first_order_like(baseline.plant)
    y, resolution = before_sensor(baseline, r.Ts, plant_pv, resolution)

    # the controller's runs within a sample take OP on its way to the next one
    early = 0.5 * (1.0 - 1.0 / seen.pace)
    data = Data(
        u=through_valve(seen.op, baseline, r.Ts) if r.mv is None else r.mv,
        y=y,
        K=plant.K * (r.Ts if plant.integrating else 1.0),
        T=0.0 if plant.integrating else float(plant.T or 0.0) / r.Ts,
        Td=max(baseline.plant.Td / r.Ts - early, 0.0),
        early=early,
        shape=beyond_first_order(baseline.plant, r.Ts),
        resolution=resolution,
        noise=seen.noise / _share_through_filter(baseline, r.Ts),
        trusted=seen.trusted,
        late=seen.law.late,
    )
    if not seen.trusted:
        return data
    num, den = polynomials(plant)

    def on_pv(period: float) -> float:
        w = 2j * np.pi / period
        return float(abs(np.polyval(num, w) / np.polyval(den, w)))

    sines = []
    for at in ("input", "output"):
        for p in _stated_loads(baseline, "sine", at):
            sines.append(
                (
                    p["period"] / r.Ts,
                    p["amplitude"] * (on_pv(p["period"]) if at == "input" else 1.0),
                )
            )
    steps = [p["amplitude"] for p in _stated_loads(baseline, "steps", "input")]
    drifts = [
        p["amplitude"] * min(r.duration / p["period"], 1.0)
        for p in _stated_loads(baseline, "ramp", "input")
    ] + [
        # a walk ends within two of its standard deviations
        2.0 * p["amplitude"] * np.sqrt(r.duration / p["period"])
        for p in _stated_loads(baseline, "random_walk", "input")
    ]
    loads = {
        # levels between -amplitude and amplitude lie up to two of them apart, of which one part is
        # fitted; some who write an amplitude mean the standard deviation
        "steps": float(np.sqrt(2.0) * np.linalg.norm(steps)),
        "slow": float(np.linalg.norm(drifts)),
    }
    return replace(data, sines=tuple(sines), loads=loads if baseline.disturbance else {})


def longest_run(x: np.ndarray) -> slice:
    """Return the longest run of true samples."""
    first, last = max(runs_of(x), key=lambda run: run[1] - run[0], default=(0, 0))
    return slice(int(first), int(last))


def moving(op: np.ndarray) -> np.ndarray:
    """Return the samples to which OP moved."""
    return np.append(False, np.abs(np.diff(op)) > 1e-9 * float(np.abs(op).max()))
