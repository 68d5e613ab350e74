"""Outliers: isolated spikes of one sample on PV.

When it is the answer: radio interference, a bubble in the line. In the archive alone the controller
does not answer them.
"""

import numpy as np

from simbench.loop.parameters import Choice, Number

SOURCE = (
    "definition: a sample is hit with probability `rate`, by +- size (0.5 to 1.5 times, evenly)"
)
BLOCK = "sensor"
PARAMETERS = {
    "rate": Number("1/sample", low=0.0, high=0.5, identity=0.0, says="share of samples hit"),
    "size": Number("PV units", low=0.0, identity=0.0, says="mean height; sign at random"),
    "at": Choice(
        ("record", "loop"),
        default="record",
        says="record: the archive only; loop: the controller sees them too",
    ),
}
ACTS = "record"


def apply(setup, p, rng):
    """Draw the spikes and put them on the archive, or on what the controller sees."""
    total = setup.sp.size
    hit = rng.random(total) < p.rate
    spikes = np.where(
        hit, p.size * rng.uniform(0.5, 1.5, total) * rng.choice([-1.0, 1.0], total), 0.0
    )
    if PARAMETERS["at"].names[int(p.at)] == "loop":
        setup.pv_add += spikes
    elif spikes.any():
        setup.recorders.append(lambda pv: pv + spikes)
