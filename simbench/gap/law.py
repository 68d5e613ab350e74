"""The controller block: does the PI law turn the recorded error into the recorded OP, and if not, what stands between?"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from simbench.gap.samples import lattice, written_unit

EXACT = 0.03  # residual of dOP, relative to dOP, below which the law is taken as known
RETUNED = 0.13  # |ln ratio| of Kc or Ti from which the tuning is another one
ZEROS = 0.04  # share of samples with OP exactly at rest from which a gap in the error is looked for


@dataclass(frozen=True, eq=False)
class Law:
    """What the controller regression found.

    `residual` is the robust size of what the best law leaves of dOP, relative to dOP (`baseline_residual`: of the baseline's).
    `found` maps effects to their parameters. `seen` is the PV the controller must have seen (None when it cannot be recovered).
    `reason` says why the block cannot be judged, `foreign` why it is no PI at all, `lag` by how many samples OP answers late,
    `strays` the samples that an otherwise exact law does not explain.
    """

    residual: float
    baseline_residual: float
    Kc: float
    Ti: float
    found: dict[str, dict[str, float]] = field(default_factory=dict)
    seen: np.ndarray | None = None
    reason: str = ""
    foreign: str = ""
    lag: int = 0
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
    # an archive that stores PV before, or OP after, the controller ran
    late = np.append(pv[0], pv[:-1])
    tries = [law]
    for sp_late in (sp,) if sp is None else (sp, np.append(sp[0], sp[:-1])):
        other = _examine(op, late, sp_late, Ts, Kc, Ti, trusted)
        seen = None if other.seen is None else np.append(other.seen[1:], pv[-1])
        tries.append(replace(other, seen=seen, lag=1))
    known = [t for t in tries if t.known]
    if known:
        return min(known, key=lambda t: t.strays.size)
    # no law is exact: the archive's PV then lies nearest to the PV recovered under the right alignment
    recovered = [t for t in tries if t.seen is not None]
    return min(recovered, key=lambda t: float(np.std(pv - t.seen))) if recovered else law


def _examine(
    op: np.ndarray, pv: np.ndarray, sp: np.ndarray | None, Ts: float, Kc: float, Ti: float | None, trusted: bool
) -> Law:
    e = (pv.mean() if sp is None else sp) - pv
    Ki = Kc * Ts / Ti if Ti else 0.0
    unit = written_unit(op, pv)
    step = lattice(op, unit)
    found: dict[str, dict[str, float]] = {}
    du = np.diff(op)
    size = _robust(du)
    if size == 0.0:
        size = float(np.std(du)) or 1.0
    lo, hi = float(op.min()), float(op.max())
    limit = _limits(op, e, Kc, Ki, step, unit, Ti is None)
    found_limits = {k: v for k, v in limit.items() if (k == "hi" and v < 99.99) or (k == "lo" and v > 0.01)}
    inside = np.ones(op.size, dtype=bool)
    if "lo" in limit:
        inside &= op > lo
    if "hi" in limit:
        inside &= op < hi
    rows = inside[1:] & inside[:-1] if Ti is None else inside[1:]
    if rows.sum() < 20:
        return Law(1.0, 1.0, Kc, Ti or np.inf, reason="OP stands at its limits nearly all the time")

    width = _error_gap(op, e, rows, unit)
    if width > 0.0:
        e = np.where(np.abs(e) <= width / 2, 0.0, e)
        found["error_deadband"] = {"width": width}
        if (rows & (du != 0.0)).sum() > 20:
            rows = rows & (du != 0.0)
            size = _robust_zero(du[rows])
    strays = np.empty(0, dtype=int)
    relevant = step > 0.0 and step > max(0.001 * float(np.std(op)), 5.0 * unit)
    if found_limits:
        found["saturation"] = {"lo": 0.0, "hi": 100.0, **found_limits}

    tolerance = (2.0 * unit + 1e-9 * np.abs(op).max()) / size
    if relevant:
        found["op_quantisation"] = {"step": step}
        a, b, left = _integrated(op, e, inside, Kc, Ki, step)
        base = left[0]
        residual = left[1]
    else:
        a, b, residual, base, strays = _regression(du, e, rows, Kc, Ki, size, with_sp_offset=sp is None)
    form = _nearest_form(a, b, Kc, Ki, Ts, Ti)
    kc, ti = form
    # OP that mostly stands still fits "no control at all" exactly
    collapsed = abs(a) < 0.02 * abs(Kc + Ki)
    law_exact = residual < max(EXACT, 3 * tolerance) and not collapsed
    base_exact = base < max(EXACT, 3 * tolerance)
    if not trusted:
        reason = "" if law_exact else "the recorded PV does not explain OP through a PI law"
        return Law(residual, residual, kc, ti, found, None, reason)
    seen, reason, foreign = None, "", ""
    plain = not relevant and width == 0.0
    if law_exact and plain:
        seen = _seen(op, e, pv, inside, a, b, Ti is None)
    if base_exact and (relevant or not law_exact):
        kc, ti = Kc, Ti or np.inf
    elif law_exact:
        shift = max(abs(np.log(max(kc / Kc, 1e-6))), abs(np.log(ti / Ti)) if Ti and np.isfinite(ti) else 0.0)
        if shift > RETUNED:
            found["detuning"] = {"Kc_factor": kc / Kc, "Ti_factor": ti / Ti if Ti and np.isfinite(ti) else 1.0}
    else:
        third = _third(du, e, rows, size)
        if third < residual / 3 and third < 0.15:
            foreign = "a third term explains OP five times better: the controller is no PI"
        else:
            candidate = _seen(op, e, pv, inside, Kc + Ki, -Kc, Ti is None) if plain else None
            if candidate is not None and np.std(pv - candidate) < 0.7 * np.std(e) + 1e-12:
                seen = candidate
                residual = base
            reason = "the recorded PV is not the PV the controller saw, or it was archived at another rate"
    if collapsed:
        foreign = "OP stands still in most samples: the controller skips scans, or a dead-band holds it"
    if law_exact and strays.size >= 3 and sp is not None:
        moved = np.flatnonzero(np.diff(sp) != 0.0) + 1
        near_sp = np.isin(strays, np.concatenate([moved, moved + 1]))
        held = np.isin(strays, np.flatnonzero(du == 0.0) + 1)
        if near_sp.mean() > 0.7 and near_sp.sum() > 0.5 * moved.size:
            foreign = "OP answers a set-point step otherwise than it answers PV"
        elif held.mean() > 0.3 and held.sum() >= 5 and width == 0.0 and not relevant:
            foreign = "OP stands still where the law would move it: the controller skips scans"
    return Law(float(residual), float(base), float(kc), float(ti), found, seen, reason, foreign, strays=strays)


def _robust(x: np.ndarray) -> float:
    return 1.4826 * float(np.median(np.abs(x - np.median(x)))) if x.size else 0.0


def _regression(
    du: np.ndarray, e: np.ndarray, rows: np.ndarray, Kc: float, Ki: float, size: float, with_sp_offset: bool
) -> tuple[float, float, float, float, np.ndarray]:
    """Fit dOP = a e_k + b e_{k-1} (+ c) robustly; return a, b, residuals of fit and baseline, stray samples."""
    X = np.column_stack([e[1:], e[:-1]] + ([np.ones(e.size - 1)] if with_sp_offset else []))[rows]
    y = du[rows]
    off = np.abs(y - X[:, :2] @ np.array([Kc + Ki, -Kc]))
    plain = np.linalg.lstsq(X, y, rcond=None)[0]
    # begin with the rows the better of two first guesses explains: spikes and limits leave at once
    guess = min((off, np.abs(y - X @ plain)), key=np.median)
    keep = guess <= np.quantile(guess, 0.6)
    beta = np.zeros(X.shape[1])
    for _ in range(8):
        beta = np.linalg.lstsq(X[keep], y[keep], rcond=None)[0]
        off = np.abs(y - X @ beta)
        # trimming, not weighting: where the law holds it holds exactly
        new = off <= max(float(np.quantile(off, 0.7)) * 2.0, 1e-12)
        if np.array_equal(new, keep):
            break
        keep = new
    off = y - X @ beta
    base = y - X[:, :2] @ np.array([Kc + Ki, -Kc])
    if with_sp_offset:
        base = base - np.median(base)
    left = _robust_zero(off) / size
    strays = np.flatnonzero(rows)[np.abs(off) > max(0.1, 20 * left) * size] + 1
    return float(beta[0]), float(beta[1]), left, _robust_zero(base) / size, strays


def _robust_zero(x: np.ndarray) -> float:
    return 1.4826 * float(np.median(np.abs(x)))


def _third(du: np.ndarray, e: np.ndarray, rows: np.ndarray, size: float) -> float:
    """Return what a law with filtered derivative leaves of dOP."""
    X = np.column_stack([e[3:], e[2:-1], e[1:-2], e[:-3], du[1:-1], du[:-2]])[rows[2:]]
    y = du[2:][rows[2:]]
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    for _ in range(4):
        off = np.abs(y - X @ beta)
        keep = off <= np.quantile(off, 0.8)
        beta = np.linalg.lstsq(X[keep], y[keep], rcond=None)[0]
    return _robust_zero(y - X @ beta) / size


def _nearest_form(a: float, b: float, Kc: float, Ki: float, Ts: float, Ti: float | None) -> tuple[float, float]:
    """Return Kc and Ti of the execution order (backward, trapezoid or forward integral) that is nearest to the baseline."""
    integral = a + b
    best = (np.inf, -b, np.inf)
    for share in (1.0, 0.5, 0.0):
        kc = a - share * integral
        if kc * Kc <= 0:
            continue
        ti = kc * Ts / integral if integral * Kc > 1e-9 * Kc * Kc else np.inf
        distance = abs(np.log(kc / Kc)) + (abs(np.log(ti / Ti)) if Ti and np.isfinite(ti) else (10.0 if Ti else 0.0))
        if distance < best[0]:
            best = (distance, kc, ti)
    return best[1], best[2]


def _integrated(
    op: np.ndarray, e: np.ndarray, inside: np.ndarray, Kc: float, Ki: float, step: float
) -> tuple[float, float, tuple[float, float]]:
    """Fit OP = c + Kc e + Ki sum(e): the law behind a coarse output, whose error does not add up."""
    total = np.cumsum(e)
    X = np.column_stack([e, total, np.ones(e.size)])
    base = op - X[:, :2] @ np.array([Kc, Ki])
    base = base - (base[inside].max() + base[inside].min()) / 2
    beta = np.linalg.lstsq(X[inside], op[inside], rcond=None)[0]
    off = op - X @ beta
    # rounding leaves +-step/2: what exceeds it is not explained
    left = [max(float(np.quantile(np.abs(r[inside]), 0.98)) / (0.5 * step) - 1.1, 0.0) for r in (base, off)]
    return float(beta[0] + beta[1]), float(-beta[0]), (left[0], left[1])


def _limits(
    op: np.ndarray, e: np.ndarray, Kc: float, Ki: float, step: float, unit: float, memoryless: bool
) -> dict[str, float]:
    """Return the extremes at which OP stands while the controller pushes outward."""
    out = {}
    want = np.median(op - Kc * e) + Kc * e[1:] if memoryless else op[:-1] + (Kc + Ki) * e[1:] - Kc * e[:-1]
    margin = max(0.6 * step, 3.0 * unit, 1e-6 * float(np.ptp(op)))
    for name, edge, sign in (("hi", float(op.max()), 1.0), ("lo", float(op.min()), -1.0)):
        at = np.abs(op[1:] - edge) < 1e-9 * max(abs(edge), 1.0)
        pushed = at & (sign * (want - edge) > margin)
        # standing twice at the very same extreme does not happen to an unlimited OP
        repeated = at[1:] & at[:-1]
        plain = pushed.sum() >= 2 if step == 0.0 else repeated.sum() >= 2 and pushed.sum() >= 4
        if plain and pushed.sum() >= 0.7 * at.sum():
            out[name] = edge
    return out


def _error_gap(op: np.ndarray, e: np.ndarray, rows: np.ndarray, unit: float) -> float:
    """Return the width of the band of |e| within which OP stands exactly still, 0 when there is none."""
    still = np.abs(np.diff(op)) <= 1e-9 * max(float(np.abs(op).max()), 1.0)
    if still[rows].mean() < ZEROS:
        return 0.0
    # still exactly when this error and the one before are inside the band
    reach = np.maximum(np.abs(e[1:]), np.abs(e[:-1]))[rows]
    still = still[rows]
    order = np.argsort(reach)
    hits = np.cumsum(np.where(still[order], 1, -1))
    split = int(np.argmax(hits))
    if split + 1 >= reach.size:
        return 0.0
    edge = 0.5 * (reach[order[split]] + reach[order[split + 1]])
    wrong = np.count_nonzero(still != (reach <= edge))
    agree = 1.0 - wrong / max(min(still.sum(), (~still).sum()), 1)
    return 2.0 * float(edge) if agree > 0.85 else 0.0


def _seen(
    op: np.ndarray, e: np.ndarray, pv: np.ndarray, inside: np.ndarray, a: float, b: float, memoryless: bool
) -> np.ndarray | None:
    """Invert dOP = a e_k + b e_{k-1}: the PV that makes the controller write this OP; recorded PV where OP stood at a limit."""
    if a == 0.0:  # OP tells nothing of the error
        return None
    if memoryless:
        gain = 0.5 * (a - b)
        return pv + e - np.where(inside, (op - np.median(op - gain * e)) / gain, e)
    forget = -b / a
    if not 0.0 <= forget < 0.9999:
        return None
    drive = np.append(e[0], np.diff(op) / a)
    out = np.empty(e.size)
    begin = 0
    # between limits the inversion is a first-order filter
    for k in [*np.flatnonzero(~inside), e.size]:
        if k > begin:
            first = drive[begin] if begin == 0 else drive[begin] + forget * e[begin - 1]
            out[begin:k] = lfilter([1.0], [1.0, -forget], np.append(first, drive[begin + 1 : k]))
        if k < e.size:
            out[k] = e[k]
        begin = k + 1
    return pv + e - out
