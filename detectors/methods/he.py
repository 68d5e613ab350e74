"""He 2007: downstream of a sticky valve the first integrating signal is a triangle wave; after
anything else it is closer to a sine.

Needs: OP of a self-regulating process (the controller integrates), PV of an integrating one; three
periods.
Parameters: `eta_low`, `eta_high` (-), published; `two_line` (0 or 1): the triangle of Eq 11.11, two
free lines, decides in place of He's; `cleaned` (1 or 0), set here: drift and noise are taken off
first. `he@chapter` has two_line = 1.
Indices: eta in 0..1 (triangle with free apex and zero ends; decides), eta_two_line in 0..1 (the
chapter's two straight lines, which have four free parameters against the sine's two and lean to
"triangle" in noise).
Rule: eta = MSE_sine / (MSE_sine + MSE_triangle), averaged over the half cycles;
>= 0.6 stiction, <= 0.4 no stiction (Eq 11.13).
Not for: flow loops with a strong P part (OP is nearly a square and scores 0.34); noise beyond a
fifth of the signal, where both misfits are noise and eta goes to 0.5.
Source: Q.P. He, J. Wang, M. Pottmann, S.J. Qin (2007), Ind. Eng. Chem. Res. 46, 4549-4560; Jelali
(2013), Eqs 11.10 to 11.13.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.half_cycles import misfit, sines, triangles, two_line_misfit
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="triangle against sine, half cycle by half cycle",
    source="He et al. 2007, Eqs 11.10-11.13",
    cannot_cope=("undersampled",),
    thresholds={
        "eta_low": Threshold(0.4, "-", 0.0, 1.0, "He 2007", "at or below: sine, no stiction"),
        "eta_high": Threshold(0.6, "-", 0.0, 1.0, "He 2007", "at or above: triangle, stiction"),
        "two_line": Threshold(
            0.0,
            "-",
            0.0,
            1.0,
            "He 2007; the chapter has 1, Eq 11.11",
            "1: two free lines; 0: a free apex",
        ),
        "cleaned": Threshold(
            1.0,
            "-",
            0.0,
            1.0,
            "own; 0 in He 2007, Procedure 11.2",
            "1: drift and noise are taken off first",
        ),
    },
    published={"cleaned": 0.0},
    chapter={"two_line": 1.0},
)


def triangle_indices(humps: np.ndarray) -> tuple[float, float]:
    """Return eta and eta_two_line of half cycles, positive humps (m, points); 0.5 when sine and
    triangle fit equally well.
    """
    points = humps.shape[1]
    errors = misfit(humps, sines(points)), misfit(humps, triangles(points)), two_line_misfit(humps)
    sine, *others = (float(error.mean()) for error in errors)
    eta, two_line = (sine / (sine + other) if sine + other > 0 else 0.5 for other in others)
    return eta, two_line


def detect(
    prepared: Prepared,
    *,
    eta_low: float,
    eta_high: float,
    two_line: float = 0.0,
    cleaned: float = 1.0,
) -> Verdict:
    """Judge a record by the shape of OP (self-regulating) or PV (integrating).

    Parameters
    ----------
    prepared : Prepared
        The record.
    eta_low, eta_high : float
        Bounds of eta (-).
    two_line : float
        1: eta_two_line decides.
    cleaned : float
        1: drift and noise are taken off first.

    Returns
    -------
    Verdict
        `score` is the eta that decides.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> record = LoopRecord(np.arcsin(np.sin(t)), np.cos(t), 0.1)
    >>> detect(Prepared(record), **METHOD.defaults()).verdict
    'stiction'
    """
    # Half cycles of OP, or of PV where the plant integrates
    name = "PV" if prepared.integrating else "OP"
    humps = prepared.half_cycles(name.lower(), cleaned > 0.5)
    if len(humps) < 4:
        return Verdict(
            "he", NO_DECISION, reason=f"{len(humps)} half cycles in {name}; at least 4 are needed"
        )

    # Triangles come from a sticky valve, sines do not
    free_apex, lines = triangle_indices(humps)
    eta = lines if two_line > 0.5 else free_apex
    if eta >= eta_high:
        verdict = STICTION
        shape = "triangular"
    elif eta <= eta_low:
        verdict = NO_STICTION
        shape = "sinusoidal"
    else:
        verdict = NO_DECISION
        shape = "between triangle and sine"

    # The verdict with its index
    reason = f"{name} is {shape}: eta = {eta:.2f} over {len(humps)} half cycles"
    return Verdict("he", verdict, eta, {"eta": free_apex, "eta_two_line": lines}, reason=reason)
