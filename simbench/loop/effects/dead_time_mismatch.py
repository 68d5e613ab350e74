"""Dead time mismatch: the plant answers later or earlier than the baseline.

When it is the answer: a longer line, a moved sampling point, a controller that waits one scan more.
"""

from simbench.loop.parameters import Number

SOURCE = "definition: Td of the plant = max(Td of the baseline + extra, 0)"
BLOCK = "process"
PARAMETERS = {
    "extra": Number(
        "s", identity=0.0, says="Td of the plant - Td of the baseline; the sum is cut at 0"
    ),
}
ACTS = "loop"


def apply(setup, p, rng):
    """Add to the dead time."""
    setup.Td = max(setup.Td + p.extra, 0.0)
