"""Curve, a valve stage: a static map whose slope changes at three knots."""

from simbench.loop.parameters import Number

SOURCE = "definition: MV = OP + sum k_i max(OP - q_i, 0), less the same at `centre`"
FRICTION = False
PARAMETERS = {
    **{
        f"q{i}": Number("% of travel", low=0.0, high=100.0, default=50.0, says=f"knot {i}")
        for i in (1, 2, 3)
    },
    **{
        f"k{i}": Number("-", low=-10.0, high=10.0, default=0.0, says=f"change of slope at knot {i}")
        for i in (1, 2, 3)
    },
    "centre": Number(
        "% of travel", low=0.0, high=100.0, default=50.0, says="OP that the map leaves where it is"
    ),
}


def start(u0, p):
    """Return the state (v,) under input `u0` (%)."""
    return (_bent(u0, p) - _bent(p.centre, p) + p.centre,)


def step(u, state, p):
    """One sample: input `u` (%) in, state (v,) out, v in % of travel."""
    return (_bent(u, p) - _bent(p.centre, p) + p.centre,)


def _bent(u, p):
    return u + p.k1 * max(u - p.q1, 0.0) + p.k2 * max(u - p.q2, 0.0) + p.k3 * max(u - p.q3, 0.0)
