"""Likelihood: how much likelier the record is with a sticky valve than with a sound one, as a
probability.

Looks for a valve map that explains, through a plant identified from the record, what PV does after
OP, better than a load and a noise of any spectrum do.
Needs: OP and PV, oscillating or not; MV, where recorded, in place of PV. SP helps to tell the
controller's direction.
Parameters: `yes`, `no` (-): probabilities from which stiction is claimed, and below which it is
denied.
Indices: probability_of_stiction (even odds before looking; the number that every verb shows), gain
(nats that friction brings over none, one a sample at most, in a model of the loop and in a
regression of PV on its past), share (fitted band over OP's range).
Rule: probability_of_stiction > yes stiction, < no none; between them, no decision. S and J are the
fitted valve's.
Not for: loops that were retuned or changed their plant within the record, plants far from first
order with dead time.
Source: generalised likelihood ratio, Kay (1998), Detection Theory, section 6.4.2; weights learned
on simulated loops of three simulators and of `ci`, the curve from them to the probability on
oscillating loops of `chapter`, `ci`, `plant` and `families` (`results/stiction_probability.txt`).
"""

from __future__ import annotations

from simbench.detectors.errors import UserError
from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.verdict import NO_DECISION, PROBABILITY, Verdict
from simbench.gap.stiction.probability import verdict
from simbench.gap.thresholds import CLAIMED_FROM, DENIED_BELOW, SHORTEST_ASKED

NAME = "likelihood"
METHOD = Method(
    title="likelihood of a sticky valve against a sound one",
    source="Kay 1998, section 6.4.2; own weights",
    budget="full",
    min_samples=int(SHORTEST_ASKED),
    front_end=False,
    whole=True,
    takes_mv=True,
    fitted_on=("chapter", "ci", "plant", "families", "own", "refinery"),
    learned=True,
    thresholds={
        "yes": Threshold(CLAIMED_FROM, "-", 0.0, 1.0, "own, simulated loops", "above: stiction"),
        "no": Threshold(DENIED_BELOW, "-", 0.0, 1.0, "own, simulated loops", "below: no stiction"),
    },
)


def detect(prepared: Prepared, *, yes: float, no: float) -> Verdict:
    """Judge a record by the likelihood.

    Examples
    --------
    >>> from simbench.detectors.example_loop import example_loop
    >>> detect(Prepared(example_loop(noise=0.1)), **METHOD.defaults()).verdict
    'stiction'
    """
    # its models take a second to load, and a list of methods needs none
    from simbench.gap.stiction.friction import friction_of, in_percent

    record = prepared.record
    try:
        weighed = friction_of(record)
    except UserError as why:
        return Verdict(NAME, NO_DECISION, reason=str(why))
    p = weighed.probability
    e = weighed.evidence
    unit = in_percent(record)[1]
    if weighed.fitted is None or e.gain <= 0.0:
        S = None
        J = None
    else:
        S, J = (x * unit for x in weighed.fitted)
    reason = f"probability of stiction {p:.2f}: friction brings {e.gain:+.0f} nats"
    if e.gain > 0.0:
        reason += f"; its band spans {e.share:.0%} of OP's range"
    indices = {PROBABILITY: p, "gain": e.gain, "share": e.share}
    return Verdict(NAME, verdict(p, yes, no), weighed.log_odds, indices, S=S, J=J, reason=reason)
