"""Tank that drains through an orifice: the outflow goes with the root of the level, so gain and
time constant rise with it.

When to choose it: level or pressure far from where the loop was tuned; the simplest plant that is
not linear.
When not: small moves about the operating point, where K/(T s + 1) says the same and theory knows
it.
"""

from math import sqrt

from simbench.loop.parameters import Number

SOURCE = (
    "Torricelli's law; Seborg, Edgar and Mellichamp (2011), Process Dynamics and Control,"
    " section 4.3"
)
INTEGRATING = False
PARAMETERS = {
    "K": Number("PV units per %", low=0.0, positive=True, says="gain at the operating point"),
    "T": Number("s", low=0.0, positive=True, says="time constant at the operating point"),
}


def start(p):
    """Return the state (deviation of the level,) at rest; pv0 > 0 is the level there."""
    return (0.0,)


def step(w_old, w_new, state, p):
    """One sample: the inflow's deviations (%), `w_old` for the rest of the dead time, `w_new` then;
    state (level,) out.

    T dh/dt = K w - 2 pv0 (sqrt(h/pv0) - 1), by the classic Runge-Kutta step.
    """
    early = (p.Td % p.Ts) / p.Ts
    push = p.K * (early * w_old + (1.0 - early) * w_new)
    h = p.Ts / p.T
    x = state[0]
    a = push - _outflow_change(x, p.pv0)
    b = push - _outflow_change(x + 0.5 * h * a, p.pv0)
    c = push - _outflow_change(x + 0.5 * h * b, p.pv0)
    d = push - _outflow_change(x + h * c, p.pv0)
    return (max(x + h / 6.0 * (a + 2.0 * (b + c) + d), -p.pv0),)


def _outflow_change(x, level):
    return 2.0 * level * (sqrt(max(1.0 + x / level, 0.0)) - 1.0)
