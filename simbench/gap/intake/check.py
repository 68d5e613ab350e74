"""The check stage: is the record fit, does the baseline belong to it, and what can be judged at all?"""

from __future__ import annotations

from typing import Any

import numpy as np

from detectors.errors import RecordError
from detectors.quality import inspect
from detectors.record import LoopRecord
from scenarios.spec import Loop, Part
from simbench.gap.controller.pi_law import Law, examine_law
from simbench.gap.intake.other_loop import refuse_other_controller, refuse_other_plant
from simbench.gap.intake.refuse import refuse_mv_units, refuse_op_units
from simbench.gap.likelihood.model import Data
from simbench.gap.sensor.samples import Samples, cleaned, inspect_samples, isolated, on_line
from simbench.gap.situation import Situation
from simbench.loop.response import valve_response

FEWEST = 100  # samples; below this the spread of every statistic swallows the gap
SAME_TS = 0.01
FINE = 0.1  # spacing of PV's lattice, in stated noise std, below which it is rounding that nobody notices
STEPS = 0.1  # share of samples; a set point that moves more often is another controller's output
STUCK = 0.01  # share of samples in standstills that no chance brings


def check(record: LoopRecord, baseline: Loop, trusted: bool = True, tuned: bool | None = None) -> Situation:
    """Refuse what cannot be compared, and settle what needs no fit.

    Parameters
    ----------
    record : LoopRecord
        SP (or None), OP, PV and, where known, MV.
    baseline : Loop
        The simulation's loop; set point, operating point and length are ignored.
    trusted : bool
        False when the baseline's plant was identified from this very record.
    tuned : bool, optional
        False when its controller was; as `trusted` when absent.

    Returns
    -------
    Situation

    Raises
    ------
    RecordError
        Too short, constant OP or PV, another sampling period, MV or OP in other units, the baseline of another loop.
    """
    where = f"record {record.tag!r}" if record.tag else "record"
    tuned = trusted if tuned is None else tuned
    op = _percent(record, where, trusted or tuned)
    _refuse_dead(record, where)
    Ts = baseline.sampling.Ts
    if abs(record.Ts / Ts - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {record.Ts:g} s by its time column, but the baseline says Ts = {Ts:g} s; they must agree within 1 %"
        )
    if record.mv is not None:
        refuse_mv_units(np.asarray(record.mv), op, where)
    notes = [f"data quality: {flag.name}: {flag.evidence}" for flag in inspect(record).values()]
    sp = record.sp
    if sp is None:
        notes.append("no set point recorded: the mean of PV stands for it")
    else:
        notes += _moves_of(sp)
    plant, control = baseline.plant, baseline.controller
    law = examine_law(op, record.pv, sp, record.Ts, control.sign * control.Kc, control.Ti, tuned)
    if tuned:
        refuse_op_units(np.asarray(record.op), law, control.sign * control.Kc, control.Ti, where)
    samples = inspect_samples(record.pv, record.op)
    if tuned and samples.step == 0.0:
        # what a coarse PV makes of an error can look like any gain
        refuse_other_controller(law, control.sign * control.Kc, where)
    proven, plant_pv, more, unexplained = _without_doubt(record, law, samples, baseline.noise.std)
    notes += more
    if not tuned:
        unexplained = ""  # a controller of which nothing was said cannot be another one
    integrating = plant.type == "integrating"
    u = _through_valve(op, baseline.valve, record.Ts) if record.mv is None else np.asarray(record.mv)
    data = Data(
        u=np.ascontiguousarray(u, dtype=float),
        y=np.ascontiguousarray(plant_pv, dtype=float),
        K=plant.K * (record.Ts if integrating else 1.0),
        T=0.0 if integrating else float(plant.T or 0.0) / record.Ts,
        Td=plant.Td / record.Ts,
        noise=baseline.noise.std if trusted else 0.0,
        resolution=_rounding(proven, samples),
        trusted=trusted,
        late=law.late,
    )
    if trusted and tuned:
        refuse_other_plant(data, law, control.sign * control.Kc, control.Ti, record.Ts, where)
    frozen = samples.held > max(20, 0.02 * record.n) or (trusted and samples.stuck > STUCK)
    frozen = frozen and "quantisation" not in proven and "compression" not in proven
    setpoint = np.full(record.n, record.pv.mean()) if sp is None else np.asarray(sp)
    return Situation(
        record, baseline, trusted, tuned, op, setpoint, law, samples, plant_pv, data, proven, notes, frozen, unexplained
    )  # fmt: skip


def _moves_of(sp: np.ndarray) -> list[str]:
    moves = np.abs(np.diff(sp))
    count = int(np.count_nonzero(moves))
    if not 0 < count < STEPS * sp.size:
        return []
    return [f"set-point steps: SP moves in {count} step{'s' * (count > 1)}, the largest {float(moves.max()):.3g}"]


def _percent(record: LoopRecord, where: str, needed: bool) -> np.ndarray:
    percent = record.op_percent
    if percent is None:
        if needed:
            raise RecordError(
                f"{where}: OP runs from {record.op.min():g} to {record.op.max():g}, which is not % of travel; "
                "give --op-span, the values that mean 0 and 100 %"
            )
        return np.asarray(record.op)
    return np.asarray(percent)


def _refuse_dead(record: LoopRecord, where: str) -> None:
    if record.n < FEWEST:
        raise RecordError(f"{where}: {record.n} samples; a gap needs at least {FEWEST} to show")
    for name, x in (("OP", record.op), ("PV", record.pv)):
        if np.ptp(x) <= 1e-9 * max(1.0, float(np.abs(x).max())):
            raise RecordError(f"{where}: {name} is constant ({x[0]:g}); nothing moved, so nothing can be told")


def _through_valve(op: np.ndarray, valve: Part, Ts: float) -> np.ndarray:
    """Return OP as the baseline's own valve passes it on: a band that the simulation has is no gap."""
    if valve.name == "ideal":
        return op
    own: dict[str, Any] = dict(valve.parameters)
    before, behind = own.pop("before", []), own.pop("behind", [])
    for stage in [*before, {"model": valve.name, **own}, *behind]:
        op = valve_response(stage["model"], op, {k: v for k, v in stage.items() if k != "model"}, Ts)
    return op


def _rounding(proven: dict, samples: Samples) -> float:
    if "quantisation" not in proven:
        return max(samples.resolution, samples.step)
    lattice = proven["quantisation"]
    return float(lattice["step"]) if lattice["at"] == "loop" else samples.resolution


def _without_doubt(
    record: LoopRecord, law: Law, samples: Samples, noise: float
) -> tuple[dict[str, dict[str, float | str]], np.ndarray, list[str], str]:
    """Return the effects that need no fit, the PV the controller saw, notes, and why the controller is a stranger."""
    proven: dict[str, dict[str, float | str]] = {e: dict(p) for e, p in law.found.items()}
    pv = np.asarray(record.pv)
    recovered_pv, notes, unexplained = law.recovered_pv, [], ""
    apart = recovered_pv is not None and bool(law.reason)  # the archive is not what the controller saw
    if samples.step > FINE * noise:
        proven["quantisation"] = {"step": samples.step, "at": "record" if apart else "loop"}
        if apart:
            pv = np.asarray(recovered_pv)
    elif samples.straight > 0.25 or _lines_where_apart(np.asarray(record.pv), recovered_pv, samples):
        size = float(np.quantile(np.abs(record.pv - recovered_pv), 0.98)) if recovered_pv is not None else 0.0
        proven["compression"] = {"band": size or 0.5 * float(np.std(np.diff(record.pv)))}
        if apart:
            pv = np.asarray(recovered_pv)
    elif samples.resolution > 0.0 and noise > 0.0 and samples.resolution > 1.5 * noise:
        proven["quantisation"] = {"step": samples.resolution, "at": "record" if apart else "loop"}
        if apart:
            pv = np.asarray(recovered_pv)
    spikes, heights, place = samples.spikes, samples.heights, "loop"
    if recovered_pv is not None and not law.foreign:
        off = record.pv - recovered_pv
        only, sizes = isolated(off, 0.0)
        # where the law is exact everywhere else, what is left of PV is the spikes alone
        strong = np.abs(sizes) > 1e-3 * float(np.std(record.pv))
        only, sizes = only[strong], sizes[strong]
        if (
            only.size >= 2
            and "compression" not in proven
            and samples.step == 0.0
            and not stands_out(np.asarray(record.pv), only, sizes)
        ):
            unexplained = "OP moves as no PV on record makes it move"
            only = only[:0]
        if only.size >= 2 and samples.step == 0.0 and "compression" not in proven:
            spikes, heights, place = only, sizes, "record"
            pv = np.asarray(recovered_pv)
    elif spikes.size >= 3 and recovered_pv is None and not _answered(record, law, spikes, heights):
        place = "record"
    if spikes.size >= 3 and "compression" not in proven:
        proven["outliers"] = {"rate": spikes.size / record.n, "size": float(np.mean(np.abs(heights))), "at": place}
        if place == "loop" or recovered_pv is None:
            pv = cleaned(pv, spikes)
    if law.reason and not apart:
        notes.append(f"controller: cannot tell, {law.reason}")
    if {"quantisation", "compression", "outliers", "error_deadband"} & set(proven):
        return proven, pv, notes, unexplained
    return proven, pv, notes, unexplained or law.foreign or law.reason


def _lines_where_apart(pv: np.ndarray, recovered_pv: np.ndarray | None, samples: Samples) -> bool:
    """Return whether PV lies on straight lines wherever it is not what the controller saw: an archive thinned a little."""
    if recovered_pv is None:
        return False
    apart = np.abs(pv - recovered_pv) > max(3.0 * samples.resolution, 1e-3 * float(np.std(pv)))
    return bool(apart.sum() >= 10 and on_line(pv, samples.resolution)[apart].mean() > 0.9)


def _answered(record: LoopRecord, law: Law, spikes: np.ndarray, heights: np.ndarray) -> bool:
    """Return whether OP jumps with the spikes of PV as the controller's gain says."""
    du = np.append(np.diff(record.op), 0.0)[np.clip(spikes - 1 + law.late, 0, record.n - 1)]
    asked = -law.Kc * heights
    return float(du @ asked) > 0.5 * float(asked @ asked)


def stands_out(pv: np.ndarray, places: np.ndarray, heights: np.ndarray) -> bool:
    """Return whether spikes that the controller did not see stand out of their neighbours in PV by just their height."""
    inner = (places > 0) & (places < pv.size - 1)
    k, h = places[inner], heights[inner]
    if k.size < 2:
        return False
    off = pv[k] - 0.5 * (pv[k - 1] + pv[k + 1])
    return float(np.median(np.abs(off - h))) < 0.5 * float(np.median(np.abs(h)))
