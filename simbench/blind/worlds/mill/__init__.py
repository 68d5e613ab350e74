"""An independent world in sampled time: exact discrete plants, controllers as products sell them, stems, an archive chain."""

from __future__ import annotations

from typing import Any

import numpy as np

from simbench.blind.worlds.mill.drawing import Item, draw
from simbench.blind.worlds.mill.effects import build
from simbench.blind.worlds.mill.foreign import KINDS

__all__ = ["FOREIGN", "TITLE", "Item", "draw", "simulate"]

TITLE = "mill: sampled time, exact discrete plants, PLC products, pneumatic stems, faults of mills, boilers and water works"
FOREIGN: dict[str, str] = {name: kind.block for name, kind in KINDS.items()}


def simulate(answer: dict[str, Any], effects: list[dict[str, Any]], seed: int, nominal: bool = False) -> dict[str, np.ndarray]:
    """Run the loop of a drawn record again: same statistics and set point, other load and noise, the given effects.

    Parameters
    ----------
    answer : dict
        Truth of a drawn record; its ``case`` and ``mv`` are read.
    effects : list of dict
        Each {"effect": id, "parameters": {...}} in place of the true one; foreign kinds of this world are understood too.
    seed : int
        The record's own seed with the true effects gives the record, bit for bit.
    nominal : bool
        On the baseline's plant instead of the true one.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        The record's columns.

    Raises
    ------
    ParameterError, UnknownName
        For an effect that cannot act in this loop, or that nobody knows.

    Examples
    --------
    >>> item = draw(1, 0, {"kind": "none", "mv": False})
    >>> again = simulate(item.answer, [], item.answer["seed"])
    >>> bool((again["pv"] == item.columns["pv"]).all())
    True
    """
    record = build(answer["case"], effects, nominal).record(seed)
    return {k: v for k, v in record.items() if answer["mv"] or k != "mv"}
