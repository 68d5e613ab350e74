"""A baseline from the record itself: tuning by regression, plant by the innovations' likelihood."""

from __future__ import annotations

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.fit import Data, Engine, Fit, Spec
from simbench.gap.law import examine_law
from simbench.gap.samples import cleaned, inspect_samples


def identify(record: LoopRecord) -> Loop:
    """Return a loop file that fits the record, without any effect in it.

    Parameters
    ----------
    record : LoopRecord
        OP, PV, and SP where recorded; `process` decides between foptd and integrating, foptd when unknown.

    Returns
    -------
    Loop

    Notes
    -----
    Not a model to design a controller with: in closed loop and without excitation K and T are known only as K/T.
    """
    op = record.op if record.op_percent is None else record.op_percent
    pv = np.asarray(record.pv)
    samples = inspect_samples(pv, record.op)
    pv = cleaned(pv, samples.spikes)
    integrating = record.process == "integrating"
    fit = fit_plant(np.ascontiguousarray(op), pv, integrating, max(samples.resolution, samples.step))
    Ts = record.Ts
    sign = 1.0 if fit.K >= 0 else -1.0
    law = examine_law(op, np.asarray(record.pv), record.sp, Ts, sign * _rough_gain(op, pv), 20.0 * Ts, trusted=False)
    Kc = abs(law.Kc) if np.isfinite(law.Kc) and law.Kc != 0 else _rough_gain(op, pv)
    Ti = law.Ti if np.isfinite(law.Ti) and law.Ti > 0 else 20.0 * Ts
    plant = {"type": "integrating" if integrating else "foptd", "K": fit.K / (Ts if integrating else 1.0), "Td": fit.theta["Td"] * Ts}
    if not integrating:
        plant["T"] = fit.theta["T"] * Ts
    return Loop.from_table({
        "plant": plant,
        "controller": {"type": "PI", "Kc": Kc, "Ti": Ti, "direction": "reverse" if sign > 0 else "direct"},
        "sampling": {"Ts": Ts, "n": record.n},
        "noise": {"std": fit.theta["noise"]},
    }, "identified loop")  # fmt: skip


def fit_plant(op: np.ndarray, pv: np.ndarray, integrating: bool, resolution: float) -> Fit:
    """Return the best first-order (or integrating) plant from OP to PV; a coarse grid, then a joint fit of its best point.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
    integrating : bool
    resolution : float
        Smallest step of PV.

    Returns
    -------
    Fit
    """
    n = op.size
    gain = float(np.std(pv)) / (float(np.std(op)) or 1.0)
    slow = (0.0,) if integrating else (0.5, 1.5, 4.0, 10.0, 30.0)
    best: Fit | None = None
    for T in slow:
        for Td in (0.0, 1.0, 3.0, 8.0):
            data = Data(op, pv, gain, T, Td, 0.0, resolution, trusted=False)
            engine = Engine(data, max(0.1 * n, 20.0))
            fit = engine.at(Spec(), engine.start())
            if best is None or fit.loglik > best.loglik:
                best, winner = fit, engine
    assert best is not None
    return winner.fit(Spec(), best.theta, steps=40)


def _rough_gain(op: np.ndarray, pv: np.ndarray) -> float:
    change = float(np.std(np.diff(pv)))
    return float(np.std(np.diff(op))) / change if change > 0 else 1.0
