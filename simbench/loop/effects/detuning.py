"""Detuning: the plant's controller is not tuned as the baseline says.

When it is the answer: someone changed Kc or Ti. The controller's law is exact, so SP, PV and OP
show it without doubt.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: Kc and Ti of the plant's controller = factors x the baseline's"
BLOCK = "controller"
PARAMETERS = {
    "Kc_factor": Number(
        "", low=0.02, high=50.0, default=1.0, says="Kc of the plant / Kc of the baseline"
    ),
    "Ti_factor": Number(
        "", low=0.02, high=50.0, default=1.0, says="Ti of the plant / Ti of the baseline (PI only)"
    ),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Scale the tuning; a P controller has no Ti to scale."""
    setup.Kc *= p.Kc_factor
    if setup.Ti is not None:
        setup.Ti *= p.Ti_factor
