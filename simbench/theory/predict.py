"""What theory expects of one loop file: the table, its refinement, the describing function and the
exact cycle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from simbench.scenarios.spec import Loop
from simbench.theory.tables import truth_columns


def predict(loop: Loop) -> dict[str, Any]:
    """Predict the limit cycle of a loop.

    Parameters
    ----------
    loop : Loop
        Noise, disturbances and set-point steps are left out.

    Returns
    -------
    dict
        table_11_3, refined (bool or None), describing_function (list of period in s, amplitude in %
        of OP, stable), exact (period in s, half peak-to-peak of OP in %, kick_min in % or None when
        no kick starts it; None when there is no cycle or the valve has no (S, J)), reason (str; it
        says, too, whether offsets of OP larger than kick_min start the cycle).

    Raises
    ------
    UnknownName, ParameterError
        For a plug-in that does not exist, or numbers it does not allow.

    Examples
    --------
    >>> found = predict(Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    ...     "valve": {"model": "choudhury", "S": 5, "J": 2},
    ...     "sampling": {"Ts": 0.5}}))
    >>> {k: round(v, 1) for k, v in found["exact"].items()}
    {'period': 92.9, 'amplitude': 2.6, 'kick_min': 3.5}
    """
    # Every prediction of the loop
    with np.errstate(all="ignore"):  # candidate cycles that grow without bound
        table, refined, theory = truth_columns(loop, kick=True)

    # The exact cycle, where there is one
    cycles = theory["by"] == "exact" and theory["exists"]
    return {
        "table_11_3": table,
        "refined": refined,
        "describing_function": [
            {"period": f.period, "amplitude": f.amplitude, "stable": f.stable}
            for f in theory["describing_function"]
        ],
        "exact": {k: theory[k] for k in ("period", "amplitude", "kick_min")} if cycles else None,
        "reason": theory["reason"],
    }


def as_text(found: dict[str, Any]) -> str:
    """Write a prediction in a few lines."""
    # the table and the describing function
    word = {True: "limit cycle", False: "no limit cycle", None: "no cell"}
    waves = []
    for f in found["describing_function"]:
        waves.append(
            f"{f['period']:.4g} s, OP +-{f['amplitude']:.4g} %,"
            f" {'stable' if f['stable'] else 'unstable'}"
        )

    # the exact cycle, and what starts it
    exact = found["exact"]
    if exact is None:
        cycle = "none"
    else:
        if exact["kick_min"] is None:
            kick = "no offset of OP starts it"
        else:
            kick = f"the least offset of OP that starts it is {exact['kick_min']:.4g} %"
        cycle = f"{exact['period']:.4g} s, OP +-{exact['amplitude']:.4g} %, {kick}"

    # a line each
    lines = [
        ("Table 11.3", word[found["table_11_3"]]),
        ("same, with conditions", word[found["refined"]]),
        ("describing function", "; ".join(waves) or "no limit cycle"),
        ("exact cycle", cycle),
    ]
    if found["reason"]:
        lines.append(("note", found["reason"]))
    return "\n".join(f"{name:<21}  {says}" for name, says in lines)
