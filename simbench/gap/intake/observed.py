"""Examine a record and its baseline as they came: signals, controller law and single samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from detectors.errors import RecordError
from detectors.quality import inspect
from detectors.record import LoopRecord
from detectors.signal.holds import holds, runs_of
from scenarios.spec import Loop
from simbench.gap.controller.examine import examine_controller
from simbench.gap.controller.pi_law import LAW_ROWS, STUCK, Law
from simbench.gap.likelihood.model import REDDEST, Data
from simbench.gap.sensor.samples import Samples, inspect_samples
from simbench.gap.situation import through_valve
from simbench.loop.plant import beyond_first_order, first_order_like

_STEPS = 0.1  # share of samples; a set point that moves more often is another controller's output


@dataclass(frozen=True, eq=False)
class Observed:
    """A record and its baseline; each of what they show is looked at once, when first asked for.

    `trusted`: the baseline's plant is its author's, not identified from this record; `tuned`: its
    controller is.
    """

    record: LoopRecord
    baseline: Loop
    trusted: bool
    tuned: bool

    @property
    def where(self) -> str:
        """The record's name, as messages begin."""
        return f"record {self.record.tag!r}" if self.record.tag else "record"

    @cached_property
    def op(self) -> np.ndarray:
        """OP in %; as recorded where the scale is not known and nothing rests on it."""
        r = self.record
        if r.op_percent is not None:
            return r.op_percent
        if self.trusted or self.tuned:
            raise RecordError(
                f"{self.where}: OP runs from {r.op.min():g} to {r.op.max():g}, which is not % of"
                " travel; give --op-span, the values that mean 0 and 100 %"
            )
        return r.op

    @property
    def sp(self) -> np.ndarray:
        """Set point; the mean of PV replaces one that was not recorded."""
        r = self.record
        return np.full(r.n, r.pv.mean()) if r.sp is None else r.sp

    @property
    def Kc(self) -> float:
        """The baseline's gain with its sign (% per PV unit)."""
        return self.baseline.controller.sign * self.baseline.controller.Kc

    @property
    def noise(self) -> float:
        """Standard deviation of PV's noise as the baseline states it, coloured noise on PV counted
        in; 0 where that is not its author's.
        """
        if not self.trusted:
            return 0.0
        coloured = (
            p["amplitude"]
            for p in self._stated("coloured")
            if p.get("at") == "output" and np.exp(-self.record.Ts / p["period"]) < REDDEST
        )
        return float(np.linalg.norm([self.baseline.noise.std, *coloured]))

    def _stated(self, kind: str) -> list[dict[str, Any]]:
        """Return the loads of a kind that the baseline states."""
        return [part.parameters for part in self.baseline.disturbance if part.name == kind]

    @cached_property
    def law(self) -> Law:
        """What turned the error into OP."""
        r, manual = self.record, self.record.meta.get("manual")
        if manual is None or not np.any(manual):
            return examine_controller(
                self.op, r.pv, r.sp, r.Ts, self.baseline, self.tuned, self.noise
            )
        # in manual OP is an input and no law is asked
        rows = longest_run(~np.asarray(manual))
        if rows.stop - rows.start < LAW_ROWS:
            return Law(0.0, 0.0, self.Kc, self.baseline.controller.Ti or np.inf)
        sp = None if r.sp is None else r.sp[rows]
        law = examine_controller(
            self.op[rows], r.pv[rows], sp, r.Ts, self.baseline, self.tuned, self.noise
        )
        return replace(law, recovered_pv=None, averaged=False, reason="")

    @property
    def apart(self) -> bool:
        """Whether the archive is not what the controller saw."""
        return self.law.recovered_pv is not None and bool(self.law.reason)

    @cached_property
    def samples(self) -> Samples:
        """What single samples of PV show."""
        return inspect_samples(self.record.pv, self.record.op, noise=self.noise)

    @property
    def frozen(self) -> bool:
        """Whether PV rests while OP moves, longer than an archive that reports by exception has it;
        without noise it rests for the dead time alone.
        """
        if self.noise > 0.0 and self.samples.stuck > STUCK:
            return True
        held = _held(self.record.pv, self.op)
        return self.samples.band == 0.0 and held > max(20, 0.02 * self.record.n)

    @property
    def notes(self) -> list[str]:
        """What the reader must know: data quality, the set point, a controller that is not
        known.
        """
        notes = [
            f"data quality: {flag.name}: {flag.evidence}" for flag in inspect(self.record).values()
        ]
        sp = self.record.sp
        notes += (
            ["no set point recorded: the mean of PV stands for it"] if sp is None else _moves_of(sp)
        )
        known = not self.law.reason or self.apart
        return notes if known else [*notes, f"controller: cannot tell, {self.law.reason}"]

    def data(self, plant_pv: np.ndarray, resolution: float) -> Data:
        """Return the engine's input, with the PV that the plant gave the controller and the unit
        that rounds it.
        """
        r, plant = self.record, first_order_like(self.baseline.plant)
        integrating = plant.integrating
        u = through_valve(self.op, self.baseline, r.Ts) if r.mv is None else r.mv
        return Data(
            u=np.ascontiguousarray(u, dtype=float),
            y=np.ascontiguousarray(plant_pv, dtype=float),
            K=plant.K * (r.Ts if integrating else 1.0),
            T=0.0 if integrating else float(plant.T or 0.0) / r.Ts,
            Td=self.baseline.plant.Td / r.Ts,
            shape=beyond_first_order(self.baseline.plant, r.Ts),
            noise=self.noise,
            resolution=resolution,
            trusted=self.trusted,
            late=self.law.late,
            sines=tuple(map(self._on_pv, self._stated("sine"))) if self.trusted else (),
            loads=self._loads if self.trusted else {},
        )

    @property
    def _loads(self) -> dict[str, float]:
        """Size (% of travel) of the steps and drifts that the baseline states at the plant's input,
        over this record; nothing where it states no load.
        """
        if not self.baseline.disturbance:
            return {}
        steps, ramps, walks = (
            [p for p in self._stated(kind) if p.get("at", "input") == "input"]
            for kind in ("steps", "ramp", "random_walk")
        )
        # between levels that are drawn evenly from -amplitude to amplitude
        jumps = [p["amplitude"] * np.sqrt(2.0 / 3.0) for p in steps]
        far = self.record.duration
        drifts = [p["amplitude"] * min(far / p["period"], 1.0) for p in ramps]
        # a walk ends within two of its standard deviations
        drifts += [2.0 * p["amplitude"] * np.sqrt(far / p["period"]) for p in walks]
        return {
            "steps": float(np.linalg.norm(jumps)),
            "slow": float(np.linalg.norm(drifts)),
        }

    def _on_pv(self, sine: dict[str, Any]) -> tuple[float, float]:
        """Return the period (samples) and the amplitude on PV of a sine that the baseline
        states.
        """
        plant, w = first_order_like(self.baseline.plant), 2.0 * np.pi / sine["period"]
        pole = 1j * w if plant.integrating else 1j * w * float(plant.T or 0.0) + 1.0
        gain = 1.0 if sine.get("at") == "output" else abs(plant.K / pole)
        return sine["period"] / self.record.Ts, sine["amplitude"] * gain


def longest_run(x: np.ndarray) -> slice:
    """Return the longest run of true samples."""
    runs = runs_of(x)
    if not len(runs):
        return slice(0, 0)
    first, last = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return slice(int(first), int(last))


def _held(pv: np.ndarray, op: np.ndarray) -> int:
    """Return the most moves of OP within one run of equal samples of PV: a loop without noise comes
    to rest as a whole.
    """
    lengths = holds(pv)
    return int(np.bincount(np.repeat(np.arange(lengths.size), lengths), moving(op)).max())


def moving(op: np.ndarray) -> np.ndarray:
    """Return the samples to which OP moved."""
    return np.append(False, np.abs(np.diff(op)) > 1e-9 * float(np.abs(op).max()))


def _moves_of(sp: np.ndarray) -> list[str]:
    moves = np.abs(np.diff(sp))
    count = int(np.count_nonzero(moves))
    if not 0 < count < _STEPS * sp.size:
        return []
    return [
        f"set-point steps: SP moves in {count} step{'s' * (count > 1)}, the largest"
        f" {float(moves.max()):.3g}"
    ]
