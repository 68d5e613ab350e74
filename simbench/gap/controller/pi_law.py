"""Test whether a PI law computes the recorded OP from the recorded error, and find what differs if
not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from simbench.detectors.signal.holds import on_line
from simbench.detectors.signal.lattice import read_lattice, written_unit
from simbench.gap.controller.law import EXACT, FORMS, Law, about_zero, by_steps, by_sums, spread
from simbench.gap.controller.pid_law import Stated
from simbench.gap.controller.recovered_pv import (
    FAITHFUL,
    MEAN_OVER,
    ROUNDED,
    hidden_law,
    recover_pv,
    rest_of_mean,
)
from simbench.gap.controller.standstill import error_gap, limits_of, skips_scans
from simbench.gap.sensor.samples import exception_band

# the law is also taken as known if its residual is below this multiple of what rounding explains
DIGITS = 2.5
# % of OP: the step of an output card of 11 bits, whose lattice decimals of a tenth of it hide
CARD = 0.05
# share of samples at rest from which a finely written OP cannot follow the mean of a moving PV: a
# controller that misses a tenth of its scans rests in more
_RESTING = 0.05
_ROUNDING = 1e-9  # residual of dOP, relative to dOP, that is no more than last bits
_HALF = 0.5  # share of OP's moves above which such rounding explains too much to be assumed
LAW_ROWS = 60  # changes of OP and PV, stored and in automatic, enough to see the law
_LOUD = 5.0  # bands of OP, of which an archive by exception misses none under another tuning either
RETUNED = 0.13  # |ln ratio| of Kc or Ti from which the tuning is another one
_DIGITS_LEFT = 2.0  # of what digits leave of a law, beyond which a faster controller leaves it
_FEW = 6  # samples kept by an archive from which it can be compared with what OP says of PV
# half steps of a coarse OP beyond half a step, below which a law explains OP: at .03 two of 164
# records lose theirs
_NEAR = 0.25
# of OP's lattice, to which rounding never brings a law: without it PV's steps, handed on, are
# called OP's in one of 164 records
_FINER = 0.02
# share of PV on straight lines from which the archive is known to have been thinned: at .17 a
# tuning goes unread in one of 164 records, and a right law is lost in another
_THINNED = 0.25


def examine_law(
    op: np.ndarray,
    pv: np.ndarray,
    sp: np.ndarray | None,
    stated: Stated,
    trusted: bool = True,
    noise: float = 0.0,
) -> Law:
    """Return the controller law that SP, PV and OP show; `trusted`: what the loop file states of
    the controller is the plant's, not identified; `noise`: standard deviation of the noise of PV.
    """

    def law_of(acts: Stated, pv: np.ndarray, sp: np.ndarray | None) -> Law:
        return _Examination(op, pv, sp, stated, acts, noise).law(trusted)

    def examined(pv: np.ndarray, sp: np.ndarray | None) -> Law:
        if sp is None:
            level = np.full(pv.size, pv.mean())
        else:
            level = sp
        forms = stated.forms
        laws = [law_of(acts, pv, sp) for acts in forms]
        if trusted and not any(law.known and law.tuning is None for law in laws):
            retimed = [form.retimed(op, pv, level) for form in forms]
            laws += [law_of(acts, pv, sp) for acts in retimed if acts is not None]
        known = [law for law in laws if law.known]

        # of forms that are exact alike the first, which the simulation runs
        return min(
            known,
            key=lambda law: (law.tuning is not None, max(law.residual, _ROUNDING)),
            default=laws[0],
        )

    return best_aligned(examined, pv, sp)


def best_aligned(
    examined: Callable[[np.ndarray, np.ndarray | None], Law],
    pv: np.ndarray,
    sp: np.ndarray | None,
) -> Law:
    """Return the law that PV and SP show where an archive may store PV before, or OP after, the
    controller ran, and SP a sample off.
    """
    law = examined(pv, sp)
    if law.known and not law.averaged:
        return law
    late = np.append(pv[0], pv[:-1])
    tries = [law]
    if sp is None:
        sps = [sp]
    else:
        sps = [sp, np.append(sp[0], sp[:-1]), np.append(sp[1:], sp[-1])]
    for shifted in sps[:2]:
        other = examined(late, shifted)
        seen = other.recovered_pv
        if seen is None:
            seen = None
        else:
            seen = np.append(seen[1:], pv[-1])
        tries.append(replace(other, recovered_pv=seen, late=1))
    tries += [examined(pv, shifted) for shifted in sps[1:]]

    # a law that is exact but for the set point's steps is only mended by what explains these
    if law.foreign and law.residual < EXACT:
        most = law.strays.size / 2
    else:
        most = pv.size
    known = [t for t in tries if t.known and t.strays.size <= most]
    if not known:
        return min((t for t in tries if t.foreign), key=lambda t: t.residual, default=law)

    # a mean explains much: it is believed where no alignment needs one, or only under another
    # tuning
    return min(known, key=lambda t: (t.tuning is not None, t.averaged, t.strays.size))


def find_retuning(
    Kc: float, Ti: float, Kc_stated: float, Ti_stated: float
) -> tuple[float, float] | None:
    """Return the factors of a tuning that differs from the stated one, None when it hardly does."""
    if np.isfinite(Ti) and np.isfinite(Ti_stated):
        Ti_factor = Ti / Ti_stated
    else:
        Ti_factor = 1.0
    factors = Kc / Kc_stated, Ti_factor
    shift = np.abs(np.log(np.maximum(factors, 1e-6))).max()
    return factors if shift > RETUNED else None


class _Examination:
    """Judges the controller under one alignment of the signals.

    `Kc` (with sign), `Ti`: the baseline's law. `e` (n,): the error of which a PI moves OP, past a
    gap of the controller's own error; `hidden`: what the bands within which an archive repeats OP
    and PV may hide of a change of OP (%). Where OP is off its `limits` and stored with PV: `inside`
    (n,) by sample, `rows` (n - 1,) by change; `told`: changes, too, of which the archive would have
    stored what the baseline asks; `size` of the changes; `rounding`: the standard deviation that
    the `digits` of OP and PV leave of them.
    """

    def __init__(
        self,
        op: np.ndarray,
        pv: np.ndarray,
        sp: np.ndarray | None,
        stated: Stated,
        acts: Stated,
        noise: float,
    ) -> None:
        self.op = op
        self.pv = pv
        self.sp = sp
        self.du = np.diff(op)
        if sp is None:
            self.level = np.full(pv.size, pv.mean())
        else:
            self.level = sp
        self.Ts = stated.Ts
        self.Kc = stated.Kc
        self.Ti = stated.Ti
        self.Ki = stated.Ki
        self.noise = noise
        self.acts = acts
        self.e = acts.error(op, pv, self.level)
        Kc = self.Kc
        per_pv = stated.per_pv
        self.op_is, self.pv_is = op_is, pv_is = read_lattice(op, pv), read_lattice(pv, op)

        # what an archive by exception repeats
        op_band = exception_band(op, max(op_is.unit, op_is.step))
        pv_band = exception_band(pv, max(pv_is.unit, pv_is.step))
        self.hidden = 2.0 * (op_band + per_pv * pv_band)
        size = spread(self.du)
        if size > 0.0:
            self.size = size
        else:
            self.size = float(np.std(self.du)) or 1.0

        # what the digits of PV leave of the law counts as those of OP
        unit = max(op_is.unit, per_pv * pv_is.digits)
        limit = limits_of(op, self.e, Kc + self.Ki, -Kc, op_is.step, unit, self.hidden)
        lo = limit.get("lo", -np.inf)
        hi = limit.get("hi", np.inf)
        inside = (op > lo) & (op < hi)

        # the ends of the range are everybody's limits
        lo = lo if lo > 0.01 else 0.0
        hi = hi if hi < 99.99 else 100.0
        if (lo, hi) == (0.0, 100.0):
            self.limits = None
        else:
            self.limits = (lo, hi)

        # a controller that holds its integral at a limit leaves it by another step
        told = inside[1:] & inside[:-1]

        # of a value that an archive repeats nobody knows what it was
        of_pv = np.append(True, np.diff(pv) != 0.0) | (pv_band == 0.0)
        kept = inside & of_pv & (np.append(True, self.du != 0.0) | (op_band == 0.0))
        rows = kept[1:] & kept[:-1]
        digits = (op_is.digits, pv_is.digits)
        if self.hidden > 0.0 and rows.sum() < LAW_ROWS:
            rows = told
            digits = (2.0 * op_band, 2.0 * pv_band)
        else:
            inside = kept
        loud = np.abs(Kc * np.diff(self.e) + self.Ki * self.e[1:]) > _LOUD * op_band
        self.inside = inside
        self.rows = rows
        self.told = told & (rows | (of_pv[1:] & of_pv[:-1] & loud))
        self.rounding = float(np.hypot(digits[0], per_pv * digits[1])) / np.sqrt(6.0)
        self.digits = digits

    def law(self, trusted: bool) -> Law:
        """Return the law; of settings that are not `trusted` no other tuning is told."""
        # At its limits OP follows no law
        if self.rows.sum() < 20:
            return Law(
                1.0,
                self.Kc,
                self.Ti or np.inf,
                reason="OP stands at its limits nearly all the time",
            )

        # The law that leaves least, in the baseline's execution order
        self._fit_law()
        fit = self.fit
        law = Law(
            fit.residual,
            *self._nearest_form(fit.a, fit.b),
            limits=self.limits,
            gap=self.gap,
            step=self.op_is.step if self.coarse else 0.0,
            strays=fit.strays,
            blur=self.rounding / abs(self.Kc),
            hidden=self.hidden,
        )

        # Of settings that nobody stated no other tuning is told
        if not trusted:
            reason = "" if self.exact else "the recorded PV does not explain OP through a PI law"
            return replace(law, reason=reason, strays=np.empty(0, dtype=int))

        # OP that stands where the law moves it: scans were skipped
        unit = max(self.op_is.unit, self.op_is.step)
        if self.plain and skips_scans(
            self.op, self.e, self._error_at, self.told, self.size, unit, self.tolerance
        ):
            return replace(
                law,
                foreign="OP stands still where the law would move it: the controller skips scans",
            )

        # A controller that runs within a sample shows no tuning of its own
        if self._runs_within_a_sample():
            none = np.empty(0, dtype=int)
            return replace(law, quick=not self.exact, Kc=self.Kc, Ti=self.Ti or np.inf, strays=none)

        # An exact law is told as it is; a hidden one by what it leaves
        if self.exact:
            return self._find_known_law(law)
        return self._find_hidden_law(law)

    def _fit_law(self) -> None:
        """Fit the law, past a gap of the error and a lattice of OP: is nothing but it between error
        and OP (`plain`), does it explain OP (`exact`)?
        """
        # Whether the lattice is OP's own, by a first fit
        op = self.op
        e = self.e
        du = self.du
        rows = self.rows
        size = self.size
        Kc = self.Kc
        Ki = self.Ki
        no_sp = self.sp is None
        step = self.op_is.step
        coarse = self.op_is.coarse > 0.0
        if coarse:
            bare = by_steps(du, e, rows, Kc, Ki, size, no_sp)
            off = du - bare.a * e[1:] - bare.b * e[:-1]
            # a law that meets OP's moves far within its lattice leaves nothing for rounding: the
            # lattice is PV's, handed on
            off = off[rows & (du != 0.0)] - np.median(off[rows])
            coarse = not off.size or bool(np.quantile(np.abs(off), 0.9) > _FINER * step)

        # The band within which the error does not count
        own = self.level - self.pv
        still = du == 0.0
        errors = [e]
        gap = error_gap(still, own, self.told)
        of_pv = self.acts.settings is not None
        if gap == 0.0 and of_pv:
            # a derivative of PV moves OP within the band, too
            still = self.acts.rests(op, self.pv, self.level, self.digits)
            gap = error_gap(still, own, self.told)
        if gap > 0.0:
            if not coarse and (rows & ~still).sum() > 20:
                rows = rows & ~still
                size = about_zero(du[rows])
            # beyond the band the error counts in full, or (in some controllers) only by what
            # exceeds it
            full = np.where(np.abs(own) <= gap / 2, 0.0, own)
            counted = full, full - np.sign(full) * gap / 2
            if of_pv:
                pvs = (None, self.pv)
            else:
                pvs = (None,)
            errors = []
            for x in counted:
                for pv in pvs:
                    errors.append(self.acts.error(op, self.level - x, self.level, slope_of=pv))

        # The fit of least residual; on a lattice that of the sums
        fits = [(by_steps(du, x, rows, Kc, Ki, size, no_sp), x) for x in errors]
        fit, e = min(fits, key=lambda f: f[0].residual)
        if coarse:
            fit = by_sums(op, e, self.inside, Kc, Ki, step)

        # OP that mostly rests fits "no control at all" exactly
        self.collapsed = bool(abs(fit.a) < 0.02 * abs(Kc + Ki) and np.mean(du[rows] == 0.0) > 0.3)
        if written_unit(op) > 0.1 * CARD:
            card = CARD / np.sqrt(6.0)
        else:
            card = 0.0
        hidden = DIGITS * max(self.rounding, card) + 1e-9 * float(np.abs(op).max())
        self.tolerance = max(_NEAR if coarse else EXACT, min(hidden / size, _HALF))

        # What the answer is read off from
        self.fit = fit
        self.e = e
        self.rows = rows
        self.size = size
        self.gap = gap
        self.coarse = coarse
        self.plain = not coarse and gap == 0.0
        self.exact = fit.residual < self.tolerance and not self.collapsed

    def _find_known_law(self, law: Law) -> Law:
        """Return the law that explains OP: the baseline's or another tuning, and which PV it was
        shown.
        """
        fit = self.fit
        sp = self.sp
        if self.plain:
            law = replace(law, recovered_pv=self._recover_change(fit.a, fit.b))

        # a baseline that explains OP as well is the simpler truth
        if (fit.base < self.tolerance and self.coarse) or fit.base < 1.5 * fit.residual:
            law = replace(law, Kc=self.Kc, Ti=self.Ti or np.inf)
        else:
            law = self._law_of_tuning(law, fit.a, fit.b)
        if fit.strays.size >= 3 and sp is not None:
            moved = np.flatnonzero(np.diff(sp) != 0.0) + 1
            near_sp = np.isin(fit.strays, np.concatenate([moved, moved + 1]))
            if near_sp.mean() > 0.7 and near_sp.sum() > 0.5 * moved.size:
                foreign = "OP answers a set-point step otherwise than it answers PV"
                law = replace(law, foreign=foreign)
        return law

    def _runs_within_a_sample(self) -> bool:
        """Return whether the baseline's law holds up to what the integral adds in one sample of how
        far the error moves in it, as where the controller runs several times in it.
        """
        left = self.fit.base * self.size
        digits = _DIGITS_LEFT * self.rounding + _ROUNDING * self.size
        most = abs(self.Ki) * about_zero(np.diff(self.e))
        # another tuning would explain much more
        return self.plain and digits < left <= most and self.fit.base < 1.5 * self.fit.residual

    def _find_hidden_law(self, law: Law) -> Law:
        """Return a law that the recorded PV does not show: another controller, or another PV than
        the archive's.
        """
        op = self.op
        pv = self.pv
        e = self.e
        Kc = self.Kc
        Ki = self.Ki

        # what the archive shows of PV: its lattice, samples on straight lines, and samples it kept
        grid = self.pv_is.coarse
        line = on_line(pv, self.pv_is.unit, self.noise) & (grid == 0.0)
        moving = np.diff(pv) != 0.0
        exact = ~line & (np.append(True, moving) | np.append(moving, True) | (grid > 0.0))
        rough = bool(line.mean() > _THINNED) or grid > 0.0
        if self.plain and not rough:
            mean = self._behind_a_mean(law)
            if mean is not None:
                return mean

        # A controller that skips scans, or any other reason
        foreign = ""
        if self.collapsed and not self.gap:
            foreign = (
                "OP stands still in most samples: the controller skips scans, or a dead-band holds"
                " it"
            )
        reason = (
            "the recorded PV is not the PV the controller saw, or it was archived at another rate"
        )
        law = replace(law, reason=reason, foreign=foreign)
        if foreign or not self.plain:
            return law

        # The tuning by samples that the archive kept
        a = Kc + Ki
        b = -Kc
        if rough and not self.limits and exact.sum() > 20:
            hidden = hidden_law(op, e, Kc, Ki, exact)
            if hidden.base > 1.5 * hidden.misfit and np.isfinite(hidden.a):
                a = hidden.a
                b = hidden.b

        # PV as the controller saw it, if it is near the recorded one
        candidate = self._recover_change(a, b)
        if candidate is None:
            return law
        off = pv - candidate
        kept = bool(rough and exact.sum() >= _FEW)
        if kept:
            if grid > 0.0:
                faithful = ROUNDED * grid
            else:
                faithful = FAITHFUL * float(np.std(off[line]))
            kept = float(np.std(off[exact])) < faithful
        if kept or np.std(off) < 0.7 * np.std(e) + 1e-12:
            law = replace(law, recovered_pv=candidate, residual=self.fit.base)
        if kept and a != Kc + Ki:
            return self._law_of_tuning(law, a, b)
        return law

    def _behind_a_mean(self, law: Law) -> Law | None:
        """Return the law, under the baseline's tuning or another, whose PV the archive took the
        mean of; None where none is.
        """
        # A mean over a sample is looked for only where OP moves
        op = self.op
        inside = self.inside
        Kc = self.Kc
        Ki = self.Ki
        rests = float(np.mean(self.du[self.rows] == 0.0))
        if self.op_is.step == 0.0 and rests > _RESTING:
            return None

        # The stated tuning in every form, and the one that the means show
        tunings = []
        for share in FORMS if Ki else FORMS[:1]:
            tunings.append((Kc + share * Ki, (1.0 - share) * Ki - Kc))
        stated = len(tunings)
        if inside.all():
            within = inside.copy()
            within[: max(MEAN_OVER)] = False
            within[-max(MEAN_OVER) :] = False
            hidden = hidden_law(op, self.e, Kc, Ki, within, MEAN_OVER)
            tunings.append((hidden.a, hidden.b))

        # What each leaves of PV, a changed tuning at a price
        tries = []
        for i, (a, b) in enumerate(tunings):
            if not np.isfinite(a):
                continue
            seen = self._recover_change(a, b)
            if seen is not None:
                # a baseline that explains the archive as well is the simpler truth
                price = 1.0 if i < stated else 1.5
                tries.append((price * rest_of_mean(self.pv[inside], seen[inside]), i, seen))
        rest, i, seen = min(tries, key=lambda t: t[0], default=(np.inf, 0, None))
        if not np.isfinite(rest):
            return None

        # The stated tuning, or the one that was found
        law = replace(law, residual=self.fit.base, recovered_pv=seen, averaged=True)
        if i >= stated:
            return self._law_of_tuning(law, *tunings[i])
        return replace(law, Kc=Kc, Ti=self.Ti or np.inf)

    def _error_at(self, runs: np.ndarray) -> np.ndarray:
        """Return the error of a controller that knows of no samples but its `runs`."""
        return self.acts.error(self.op[runs], self.pv[runs], self.level[runs])

    def _recover_change(self, a: float, b: float) -> np.ndarray | None:
        pv = recover_pv(self.op, self.e, self.pv, self.inside, a, b, self.Ti is None)
        if pv is None:
            return None
        change = self.acts.unshaped(pv - self.pv)
        if change is None:
            return None
        return self.pv + change

    def _law_of_tuning(self, law: Law, a: float, b: float) -> Law:
        """Return the law with the tuning of dOP = a e_k + b e_{k-1}."""
        Kc, Ti = self._nearest_form(a, b)
        return replace(law, Kc=Kc, Ti=Ti, tuning=find_retuning(Kc, Ti, self.Kc, self.Ti or np.inf))

    def _nearest_form(self, a: float, b: float) -> tuple[float, float]:
        """Return Kc and Ti of the execution order that is nearest to the baseline; of the backward
        one when none is near.

        Under backward integration, which the simulation runs, the two numbers reproduce this very
        OP.
        """
        # Every order of execution has its own Kc and Ti
        Kc = self.Kc
        Ti = self.Ti
        Ts = self.Ts
        integral = a + b
        best = (np.inf, -b, np.inf)
        for share in FORMS:
            kc = a - share * integral
            if kc * Kc <= 0:
                continue
            if integral * Kc > 1e-9 * Kc * Kc:
                ti = kc * Ts / integral
            else:
                ti = np.inf

            # The distance in logarithms; the baseline's order wins unless another is much nearer
            distance = abs(np.log(kc / Kc)) + (
                abs(np.log(ti / Ti)) if Ti and np.isfinite(ti) else (10.0 if Ti else 0.0)
            )
            if distance < best[0] and (share == FORMS[0] or distance < 2 * RETUNED):
                best = (distance, kc, ti)
        return best[1], best[2]
