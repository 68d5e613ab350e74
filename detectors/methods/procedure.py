"""The chapter's diagnosis procedure as one method: quality, oscillation, saturation, then
the detectors together.

Needs: OP and PV; where the loop does not oscillate, MV or the PV of a flow loop.
Parameters: `odds_low`, `odds_high` (log-odds on the grids that the weights were fitted to), set
here: a score, no probability; `follow_min` (-), set here from simulated loops; `weighted` (1 or 0),
set here: in the source a majority of verdicts decides; `veto` (0 or 1): in the source a
nonlinearity that is not seen ends the search.
Indices: log_odds (stiction against none, from the weighted indices of the detectors), follow (0..1,
a dead band between OP and the valve seen without an oscillation), ngi, nli, regularity, period_s.
Rule: log_odds >= odds_high stiction, <= odds_low none. Without a sustained oscillation: stiction
where the valve is seen to stand still, else none. Saturation of OP: no decision.
Not for: replacing the confirmation tests; `simbench diagnose` names the next.
Source: Jelali (2013), section 11.9; the weights are fitted to simulated loops.
"""

from __future__ import annotations

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.procedure import FOLLOW_MIN, ODDS_HIGH, ODDS_LOW, ProcedureRules, walk
from simbench.detectors.verdict import Verdict

METHOD = Method(
    title="the diagnosis procedure as a whole",
    source="Jelali 2013, section 11.9",
    front_end=False,
    fitted_on=("chapter", "plant"),
    thresholds={
        "odds_low": Threshold(ODDS_LOW, "log-odds", -20.0, 20.0, "own", "at or below: no stiction"),
        "odds_high": Threshold(ODDS_HIGH, "log-odds", -20.0, 20.0, "own", "at or above: stiction"),
        "follow_min": Threshold(
            FOLLOW_MIN, "-", 0.0, 1.0, "own, simulated loops", "at or above: the valve stands still"
        ),
        "weighted": Threshold(
            1.0,
            "-",
            0.0,
            1.0,
            "own; the source has 0",
            "1: indices are weighed; 0: verdicts are counted",
        ),
        "veto": Threshold(
            0.0,
            "-",
            0.0,
            1.0,
            "own; the source has 1",
            "1: no stiction where no nonlinearity is seen",
        ),
    },
    published={"weighted": 0.0, "veto": 1.0, "follow_min": 1.0},
)


def detect(
    prepared: Prepared,
    *,
    odds_low: float,
    odds_high: float,
    follow_min: float,
    weighted: float,
    veto: float,
) -> Verdict:
    """Judge a record by the procedure.

    Parameters
    ----------
    prepared : Prepared
        The record.
    odds_low, odds_high : float
        Bounds of the log-odds.
    follow_min : float
        Bound of the score of a valve seen directly (-).
    weighted, veto : float
        1 or 0: weigh indices in place of counting verdicts; let a nonlinearity that is not seen end
        the search.

    Returns
    -------
    Verdict
        `score` is the log-odds.

    Examples
    --------
    >>> import numpy as np
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(3000) / 10
    >>> detect(Prepared(LoopRecord(np.sin(t), -np.sin(t), 1.0)), **METHOD.defaults()).verdict
    'no_stiction'
    """
    diagnosis = walk(
        prepared, ProcedureRules(odds_low, odds_high, follow_min, weighted > 0.5, veto > 0.5)
    )
    return Verdict(
        "procedure",
        diagnosis.verdict,
        diagnosis.score,
        diagnosis.indices,
        S=diagnosis.S,
        J=diagnosis.J,
        reason=diagnosis.reason,
    )
