"""The controller block: does the PI law turn the recorded error into the recorded OP, and if not, what stands between?"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from simbench.gap.controller.recovered_pv import FAITHFUL, ROUNDED, hidden_law, recover_pv
from simbench.gap.controller.regression import FORMS, about_zero, by_steps, by_sums, spread, with_derivative
from simbench.gap.controller.standstill import error_gap, limits_of, skips_scans
from simbench.gap.sensor.samples import lattice, on_line, written_unit
from simbench.loop.effects import EFFECTS

EXACT = 0.03  # residual of dOP, relative to dOP, below which the law is taken as known
RETUNED = 0.13  # |ln ratio| of Kc or Ti from which the tuning is another one
FEW = 6  # samples kept by an archive from which it can be compared with what OP says of PV
FINER = 0.02  # of OP's lattice, to which rounding never brings a law
THINNED = 0.25  # share of PV on straight lines from which the archive is known to have been thinned


@dataclass(frozen=True, eq=False)
class Law:
    """What the controller regression found.

    `residual` is the robust size of what the best law leaves of dOP, relative to dOP (`baseline_residual`: of the baseline's).
    `found` maps effects to their parameters. `recovered_pv` is the PV the controller must have seen (None when it cannot be
    recovered).
    `reason` says why the block cannot be judged, `foreign` why it is no PI at all, `late` by how many samples OP answers late,
    `strays` the samples that an otherwise exact law does not explain.
    """

    residual: float
    baseline_residual: float
    Kc: float
    Ti: float
    found: dict[str, dict[str, float]] = field(default_factory=dict)
    recovered_pv: np.ndarray | None = None
    reason: str = ""
    foreign: str = ""
    late: int = 0
    strays: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))

    @property
    def known(self) -> bool:
        """Whether a PI law turns the recorded error into OP."""
        return not (self.reason or self.foreign)


def examine_law(
    op: np.ndarray, pv: np.ndarray, sp: np.ndarray | None, Ts: float, Kc: float, Ti: float | None, trusted: bool = True
) -> Law:
    """Judge the controller from SP, PV and OP.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
        In % and PV units.
    sp : ndarray or None
        Set point; None stands for an unknown constant.
    Ts : float
        Sampling period (s).
    Kc : float
        Baseline gain with the sign of the direction (% per PV unit).
    Ti : float or None
        Baseline integral time (s); None for a P controller.
    trusted : bool
        False: no baseline; tuning is only estimated.

    Returns
    -------
    Law
    """
    law = _examine(op, pv, sp, Ts, Kc, Ti, trusted)
    if law.known:
        return law
    # an archive that stores PV before, or OP after, the controller ran, and one that stores SP a sample off
    late = np.append(pv[0], pv[:-1])
    tries = [law]
    for sp_late in (sp,) if sp is None else (sp, np.append(sp[0], sp[:-1])):
        other = _examine(op, late, sp_late, Ts, Kc, Ti, trusted)
        recovered_pv = None if other.recovered_pv is None else np.append(other.recovered_pv[1:], pv[-1])
        tries.append(replace(other, recovered_pv=recovered_pv, late=1))
    if sp is not None:
        tries += [_examine(op, pv, s, Ts, Kc, Ti, trusted) for s in (np.append(sp[0], sp[:-1]), np.append(sp[1:], sp[-1]))]
    # a law that is exact but for the set point's steps is only mended by what explains these
    most = law.strays.size / 2 if law.foreign and law.residual < EXACT else op.size
    known = [t for t in tries if t.known and t.strays.size <= most]
    if known:
        return min(known, key=lambda t: t.strays.size)
    foreign = [t for t in tries if t.foreign]
    if foreign:
        return min(foreign, key=lambda t: t.residual)
    # no law is exact: the archive's PV then lies nearest to the PV recovered under the right alignment
    recovered = [t for t in tries if t.recovered_pv is not None]
    return min(recovered, key=lambda t: float(np.std(pv - t.recovered_pv))) if recovered else law


def _examine(
    op: np.ndarray, pv: np.ndarray, sp: np.ndarray | None, Ts: float, Kc: float, Ti: float | None, trusted: bool
) -> Law:
    e = (pv.mean() if sp is None else sp) - pv
    Ki = Kc * Ts / Ti if Ti else 0.0
    unit = written_unit(op, pv)
    step = lattice(op, unit)
    found: dict[str, dict[str, float]] = {}
    du = np.diff(op)
    size = spread(du)
    if size == 0.0:
        size = float(np.std(du)) or 1.0
    first = _first_guess(op, e, du, Kc, Ki, size, sp is None)
    limit = limits_of(op, e, *first, step, unit, Ti is None)
    limits = {k: v for k, v in limit.items() if (k == "hi" and v < 99.99) or (k == "lo" and v > 0.01)}
    inside = np.ones(op.size, dtype=bool)
    if "lo" in limit:
        inside &= op > limit["lo"]
    if "hi" in limit:
        inside &= op < limit["hi"]
    rows = inside[1:] & inside[:-1] if Ti is None else inside[1:]
    if rows.sum() < 20:
        return Law(1.0, 1.0, Kc, Ti or np.inf, reason="OP stands at its limits nearly all the time")
    if limits:
        found["saturation"] = {"lo": 0.0, "hi": 100.0, **limits}

    relevant = step > 0.0 and step > max(0.001 * float(np.std(op)), 5.0 * unit)
    if relevant:
        bare = by_steps(du, e, rows, Kc, Ki, size, sp is None)
        off = du - bare.a * e[1:] - bare.b * e[:-1]
        # a law that meets OP far within its lattice leaves nothing for rounding: the lattice is PV's, handed on
        relevant = float(np.quantile(np.abs(off[rows] - np.median(off[rows])), 0.9)) > FINER * step
    grid = lattice(pv, written_unit(pv, op))
    line = on_line(pv, written_unit(pv, op)) if grid == 0.0 else np.zeros(pv.size, dtype=bool)
    moving = np.diff(pv) != 0.0
    exact = ~line & (np.append(True, moving) | np.append(moving, True) | (grid > 0.0))
    rough = bool(line.mean() > THINNED) or grid > 0.0
    fit, width = None, error_gap(op, e, rows, 0.5 if rough else 0.85)
    if width > 0.0:
        found["error_deadband"] = {"width": width}
        if not relevant and (rows & (du != 0.0)).sum() > 20:
            rows = rows & (du != 0.0)
            size = about_zero(du[rows])
        # beyond the band the error counts in full, or (in some controllers) only by what exceeds it
        full = np.where(np.abs(e) <= width / 2, 0.0, e)
        fits = [(by_steps(du, x, rows, Kc, Ki, size, sp is None), x) for x in (full, full - np.sign(full) * width / 2)]
        fit, e = min(fits, key=lambda f: f[0].residual)
    tolerance = (2.0 * unit + 1e-9 * np.abs(op).max()) / size
    if relevant:
        found["op_quantisation"] = {"step": step}
        fit = by_sums(op, e, inside, Kc, Ki, step)
    elif fit is None:
        fit = by_steps(du, e, rows, Kc, Ki, size, sp is None)
    kc, ti = _nearest_form(fit.a, fit.b, Kc, Ki, Ts, Ti)
    # OP that mostly stands still fits "no control at all" exactly
    collapsed = abs(fit.a) < 0.02 * abs(Kc + Ki) and np.mean(du[rows] == 0.0) > 0.3
    law_exact = fit.residual < max(EXACT, 3 * tolerance) and not collapsed
    base_exact = fit.base < max(EXACT, 3 * tolerance)
    if not trusted:
        reason = "" if law_exact else "the recorded PV does not explain OP through a PI law"
        return Law(fit.residual, fit.residual, kc, ti, found, None, reason)
    recovered_pv, reason, foreign, residual = None, "", "", fit.residual
    plain = not relevant and width == 0.0
    if plain and skips_scans(op, e, inside, size, unit):
        foreign = "OP stands still where the law would move it: the controller skips scans"
    elif law_exact:
        if plain:
            recovered_pv = recover_pv(op, e, pv, inside, fit.a, fit.b, Ti is None)
        # a baseline that explains OP as well is the simpler truth
        if (base_exact and relevant) or fit.base < 1.5 * fit.residual:
            kc, ti = Kc, Ti or np.inf
        else:
            found |= _retuned(kc / Kc, ti / Ti if Ti and np.isfinite(ti) else 1.0)
        if fit.strays.size >= 3 and sp is not None:
            moved = np.flatnonzero(np.diff(sp) != 0.0) + 1
            near_sp = np.isin(fit.strays, np.concatenate([moved, moved + 1]))
            if near_sp.mean() > 0.7 and near_sp.sum() > 0.5 * moved.size:
                foreign = "OP answers a set-point step otherwise than it answers PV"
    elif base_exact:
        kc, ti = Kc, Ti or np.inf
    else:
        third = with_derivative(du, e, rows, size)
        hidden = hidden_law(op, e, Kc, Ki, exact) if rough and plain and not limits and exact.sum() > 20 else None
        if third < residual / 3 and third < 0.15:
            foreign = "a third term explains OP five times better: the controller is no PI"
        elif collapsed and not width:
            foreign = "OP stands still in most samples: the controller skips scans, or a dead-band holds it"
        elif plain:
            a, b = Kc + Ki, -Kc
            if hidden is not None and hidden.base > 1.5 * hidden.misfit and np.isfinite(hidden.a):
                a, b = hidden.a, hidden.b
            candidate = recover_pv(op, e, pv, inside, a, b, Ti is None)
            if candidate is not None:
                off = pv - candidate
                left = float(np.std(off[exact]))
                kept = (
                    rough
                    and exact.sum() >= FEW
                    and left < (ROUNDED * grid if grid > 0.0 else FAITHFUL * float(np.std(off[line])))
                )
                if kept or np.std(off) < 0.7 * np.std(e) + 1e-12:
                    recovered_pv, residual = candidate, fit.base
                if kept and a != Kc + Ki:
                    kc, ti = _nearest_form(a, b, Kc, Ki, Ts, Ti)
                    found |= _retuned(kc / Kc, ti / Ti if Ti and np.isfinite(ti) else 1.0)
        reason = "the recorded PV is not the PV the controller saw, or it was archived at another rate"
    return Law(float(residual), float(fit.base), float(kc), float(ti), found, recovered_pv, reason, foreign, strays=fit.strays)


def _retuned(Kc_factor: float, Ti_factor: float) -> dict[str, dict[str, float]]:
    """Return the effect of a tuning that differs from the baseline's, nothing when it hardly does or no tuning could."""
    bounds = EFFECTS["detuning"].parameters["Kc_factor"]
    if not bounds.low <= Kc_factor <= bounds.high:
        return {}
    shift = max(abs(np.log(max(Kc_factor, 1e-6))), abs(np.log(Ti_factor)))
    return {"detuning": {"Kc_factor": Kc_factor, "Ti_factor": Ti_factor}} if shift > RETUNED else {}


def _first_guess(
    op: np.ndarray, e: np.ndarray, du: np.ndarray, Kc: float, Ki: float, size: float, no_sp: bool
) -> tuple[float, float]:
    """Return a and b by the samples at which OP is surely at no limit; the baseline's where no law is exact."""
    held = np.isin(op, (op.min(), op.max()))
    rows = ~(held[1:] | held[:-1])
    if rows.sum() >= 20:
        fit = by_steps(du, e, rows, Kc, Ki, size, no_sp)
        if fit.residual < EXACT and fit.a * Kc > 0.0 and abs(fit.a) > 0.02 * abs(Kc):
            return fit.a, fit.b
    return Kc + Ki, -Kc


def _nearest_form(a: float, b: float, Kc: float, Ki: float, Ts: float, Ti: float | None) -> tuple[float, float]:
    """Return Kc and Ti of the execution order that is nearest to the baseline; of the backward one when none is near.

    Under backward integration, which the simulation runs, the two numbers reproduce this very OP.
    """
    integral = a + b
    best = (np.inf, -b, np.inf)
    for share in FORMS:
        kc = a - share * integral
        if kc * Kc <= 0:
            continue
        ti = kc * Ts / integral if integral * Kc > 1e-9 * Kc * Kc else np.inf
        distance = abs(np.log(kc / Kc)) + (abs(np.log(ti / Ti)) if Ti and np.isfinite(ti) else (10.0 if Ti else 0.0))
        if distance < best[0] and (share == FORMS[0] or distance < 2 * RETUNED):
            best = (distance, kc, ti)
    return best[1], best[2]
