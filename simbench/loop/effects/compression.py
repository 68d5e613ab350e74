"""Compression: the archive keeps a few points of PV and draws straight lines between them.

When it is the answer: PV is piecewise straight, while OP shows that the controller saw more. It
acts on the record only.
"""

import numpy as np

from simbench.loop.parameters import Number

SOURCE = "Bristol (1990), Swinging door trending, ISA"
BLOCK = "sensor"
PARAMETERS = {
    "band": Number(
        "PV units", low=0.0, identity=0.0, says="half width of the door: the largest error"
    ),
}
ACTS = "record"


def apply(setup, p, rng):
    """Send the recorded PV through a swinging door and back."""
    if p.band > 0.0:
        setup.recorders.append(lambda pv: swinging_door(pv, p.band))


def swinging_door(pv, band):
    """Return PV as an archive rebuilds it after swinging-door compression: no sample is further
    than `band` from its rebuilt value.
    """
    kept = [0]
    start = 0
    low = -np.inf
    high = np.inf
    values = pv.tolist()
    for k in range(1, len(values)):
        run = k - start
        slope = (values[k] - values[start]) / run
        # the line to this sample would leave an earlier one too far away
        if not low <= slope <= high:
            start = k - 1
            kept.append(start)
            low = -np.inf
            high = np.inf
            run = 1
        low = max(low, (values[k] - values[start] - band) / run)
        high = min(high, (values[k] - values[start] + band) / run)
    kept.append(len(values) - 1)
    return np.interp(np.arange(len(values)), kept, pv[kept])
