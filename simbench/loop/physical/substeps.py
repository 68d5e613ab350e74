"""Fixed sub-steps for any of the dry friction laws: slow and first-order, the obvious twin of the
exact motion.
"""

from math import ceil, exp


def slide_in_substeps(u, x, r, fs, fd, vs, a, w2, rest, T, substep):
    """Return (position in %, rate in %/s) after T s under OP `u` (%), in equal steps of at most
    `substep` s.

    Euler for the rate, its mean over the step for the position. A step that would reverse the
    motion, or end it at `rest` or slower, ends at rate zero; a valve at rate zero leaves only when
    |OP - position| > fs. Friction falls from fs to fd with speed over vs (%/s, Stribeck), at once
    for vs = 0. Each sub-step is taken, standing or not.
    """
    n = ceil(T / substep - 1e-9)
    h = T / n
    for _ in range(n):
        if r == 0.0:
            if abs(u - x) <= fs:
                continue
            d = 1.0 if u > x else -1.0
        else:
            d = 1.0 if r > 0.0 else -1.0
        friction = fd
        if vs > 0.0:
            friction = fd + (fs - fd) * exp(-(r / vs) * (r / vs))
        r1 = r + h * (w2 * (u - x - d * friction) - 2.0 * a * r)
        if d * r1 <= rest:
            r1 = 0.0
        x = min(max(x + 0.5 * h * (r + r1), 0.0), 100.0)
        r = r1
    return x, r
