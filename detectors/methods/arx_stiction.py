"""ARX with a sticking valve: PV regressed on its own past and on the position of a valve, once with
friction and once without.

Needs: OP and PV, either process type, three periods. S and J are in % of travel where OP is in %.
Parameters: `gain_low`, `gain_high` (nats), set here on simulated loops.
Indices: gain (nats that the best sticking valve brings over one that follows OP, the numbers
searched paid for, one nat at most for each average), S_hat, J_hat (unit of OP).
Rule: gain >= gain_high: stiction; below gain_low: none; between them: no decision. The past of PV
gives load and noise any spectrum, so that no oscillation from outside needs a valve; both of
Choudhury's and He's maps are tried.
Not for: records of fewer than some 250 samples, whose past takes most of them; PV that an archive
holds or draws.
Source: the structure, an ARX model behind a sticking valve, is that of R. Srinivasan, R.
Rengaswamy, S. Narasimhan, R. Miller (2005), Ind. Eng. Chem. Res. 44, 6719-6728, and M. Jelali
(2008), J. Process Control 18, 632-642; the long past and the comparison of likelihoods are own.
"""

from __future__ import annotations

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.fits.regression import regression
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="sticky valve in an ARX model of PV",
    source="Srinivasan et al. 2005b, Jelali 2008; own comparison",
    budget="full",
    fitted_on=("chapter", "plant", "families"),
    thresholds={
        "gain_low": Threshold(15.0, "nats", -100.0, 1e6, "own", "below: a sound valve will do"),
        "gain_high": Threshold(25.0, "nats", -100.0, 1e6, "own", "at or above: it sticks"),
    },
)


def detect(prepared: Prepared, *, gain_low: float, gain_high: float) -> Verdict:
    """Judge a record by what a sticking valve explains of PV beyond one that follows OP.

    Parameters
    ----------
    prepared : Prepared
        The record.
    gain_low, gain_high : float
        Bounds of the gain (nats).

    Returns
    -------
    Verdict
        `score` is the gain.

    Examples
    --------
    >>> import numpy as np
    >>> from simbench.detectors.record import LoopRecord
    >>> from simbench.detectors.signal.stiction_map import valve_position
    >>> rng = np.random.default_rng(0)
    >>> op = 50 + 3 * np.abs((np.arange(1500) % 60) / 15 - 2) + 0.05 * rng.standard_normal(1500)
    >>> pv = np.convolve(valve_position(op, 4.0, 1.5) - 50, 0.1 * 0.9 ** np.arange(80))[:1500]
    >>> pv += 0.02 * rng.standard_normal(1500)
    >>> detect(Prepared(LoopRecord(op, -pv, 1.0)), **METHOD.defaults()).verdict
    'stiction'
    """
    # The best valve by regression, and what it gains
    record = prepared.record
    found = regression(record.op, record.pv, prepared.period)
    if not len(found.valves):
        return Verdict(
            "arx_stiction", NO_DECISION, reason="too few samples, or a signal that rests"
        )
    S, J, _ = (float(x) for x in found.valves[0])
    gain = found.gain
    indices = {"gain": found.gain, "S_hat": S, "J_hat": J}
    reason = f"a valve with S = {S:.2g} and J = {J:.2g} explains PV better by {gain:+.0f} nats"

    # Enough gain is stiction, little is none
    if gain >= gain_high:
        return Verdict("arx_stiction", STICTION, gain, indices, S=S, J=J, reason=reason)
    answer = NO_STICTION if gain < gain_low else NO_DECISION
    return Verdict("arx_stiction", answer, gain, indices, reason=reason)
