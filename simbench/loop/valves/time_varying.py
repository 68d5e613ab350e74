"""Stiction that grows or shrinks with time: S and J run linearly from one value to another.

When to choose it: wear, a packing that was tightened too far and beds in, temperature; and to see
how a detector that assumes one S for the whole record copes.
When not: the change is a matter of minutes on and off (`intermittent`), or of direction
(`asymmetric`). Friction holds back, it never pushes: when the band widens under a moving valve, the
valve waits in place.
"""

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import FOLLOWS, Number
from simbench.valve.maps import stick

SOURCE = (
    "Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641-658, with S and J"
    " linear in time"
)
FRICTION = True
PARAMETERS = {
    "S": Number("% of travel", low=0.0, high=100.0, says="dead-band plus stick band until t_begin"),
    "J": Number("% of travel", low=0.0, high=100.0, says="slip jump until t_begin"),
    "S_end": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=FOLLOWS,
        says="S from t_end on; as S when absent",
    ),
    "J_end": Number(
        "% of travel",
        low=0.0,
        high=100.0,
        default=FOLLOWS,
        says="J from t_end on; as J when absent",
    ),
    "t_begin": Number("s", low=0.0, default=0.0, says="time at which S and J begin to change"),
    "t_end": Number("s", low=0.0, says="time at which they arrive"),
}


def complete(values, where):
    """Fill S_end and J_end where they are absent."""
    for name in ("S", "J"):
        if values[f"{name}_end"] != values[f"{name}_end"]:
            values[f"{name}_end"] = values[name]
    if values["t_end"] <= values["t_begin"]:
        raise ParameterError(
            f"{where}: t_end = {values['t_end']:g} s must come after t_begin ="
            f" {values['t_begin']:g} s"
        )
    return values


def start(u0, p):
    """Return the state (v, d, moving, u_prev, k) at rest in mid-band under OP `u0` (%); k counts
    samples.
    """
    x = min(max(u0, 0.0), 100.0)
    return x, 0.0, 0.0, x, 0.0


def step(u, state, p):
    """One sample: OP `u` (%) in, state (v, d, moving, u_prev, k) out, v = MV (%)."""
    v, d, moving, u_prev, k = state
    share = min(max((k * p.Ts - p.t_begin) / (p.t_end - p.t_begin), 0.0), 1.0)
    S = p.S + share * (p.S_end - p.S)
    J = p.J + share * (p.J_end - p.J)
    new, d, moving, u_prev = stick(u, (v, d, moving, u_prev), S, J)
    if (new - v) * d > 0.0:
        v = new
    return v, d, moving, u_prev, k + 1.0


def mapped_SJ(p):
    """Return (S, J) in % of travel at the end of the change, where the valve stays."""
    return p.S_end, p.J_end


def for_SJ(S, J, period):
    """Return the parameters that arrive at (S, J) from half of it within ten periods of `period`
    (s).
    """
    return {"S": 0.5 * S, "J": 0.5 * J, "S_end": S, "J_end": J, "t_end": 10.0 * period}
