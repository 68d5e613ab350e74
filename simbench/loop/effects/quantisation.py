"""Quantisation: PV stands on a lattice.

When it is the answer: a transmitter of few bits (the controller sees the steps), or an archive that
rounds. A lattice finer than the noise changes nothing but the last digits.
"""

import numpy as np

from simbench.loop.parameters import Choice, Number

SOURCE = "Widrow and Kollar (2008), Quantization Noise, ch. 1"
BLOCK = "sensor"
PARAMETERS = {
    "step": Number("PV units", low=0.0, identity=0.0, says="lattice spacing; 0 = none"),
    "at": Choice(
        ("loop", "record"),
        default="loop",
        says="loop: the transmitter, the controller sees it; record: the archive only",
    ),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Round PV in the transmitter, or in the archive alone."""
    if p.step == 0.0:
        return
    if PARAMETERS["at"].names[int(p.at)] == "loop":
        setup.pv_step = p.step
    else:
        setup.recorders.append(lambda pv: p.step * np.round(pv / p.step))
