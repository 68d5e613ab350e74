"""Parameter schemas of the effect files, taken from the one vocabulary in `names`."""

from __future__ import annotations

from simbench.gap import names
from simbench.loop.parameters import FOLLOWS, Choice, Number


def parameters(effect: str, *required: str, follows: tuple[str, ...] = ()) -> dict[str, Number | Choice]:
    """Return PARAMETERS of an effect file.

    Parameters
    ----------
    effect : str
        Effect id.
    *required : str
        Parameters that a loop file must give; all others default to the value at which they do nothing.
    follows : tuple of str
        Parameters that arrive as NaN when absent, for `apply` to fill in.

    Returns
    -------
    dict of str to Number or Choice

    Examples
    --------
    >>> parameters("deadband", "S")["S"].unit
    '% of travel'
    """
    schema: dict[str, Number | Choice] = {}
    for name, q in names.EFFECTS[effect].parameters.items():
        if isinstance(q, names.Choice):
            schema[name] = Choice(q.words, default=q.words[0], says=q.says)
            continue
        default = None if name in required else FOLLOWS if name in follows else q.identity
        unit = "" if q.unit == "-" else q.unit
        schema[name] = Number(unit, q.low, q.high, default, q.says)
    return schema
