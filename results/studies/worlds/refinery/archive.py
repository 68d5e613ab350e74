"""The historian: exception reports, swinging door, coarse lattice, decimals; all act on the record,
never on the loop.
"""

from __future__ import annotations

import numpy as np

STYLES = ("digits", "decimals")


def swinging_door(x, band):
    """Thin a series by a swinging door of half width `band` and rebuild it by straight lines.

    The door keeps every point between two archived ones within `band` of their line (Bristol 1990,
    US patent 4669097): the slopes allowed by the points so far narrow until no line is left; then
    the point before is archived.
    """
    n = x.size
    out = x.copy()
    start, k = 0, 1
    low, high = -np.inf, np.inf
    while k < n:
        slope = (x[k] - x[start]) / (k - start)
        if k > start + 1 and (slope < low or slope > high):
            end = k - 1
            for i in range(start + 1, end):
                out[i] = x[start] + (x[end] - x[start]) * (i - start) / (end - start)
            start = end
            low, high = -np.inf, np.inf
            continue
        low = max(low, (x[k] - band - x[start]) / (k - start))
        high = min(high, (x[k] + band - x[start]) / (k - start))
        k += 1
    for i in range(start + 1, n - 1):
        out[i] = x[start] + (x[n - 1] - x[start]) * (i - start) / (n - 1 - start)
    return out


def exceptions(x, band):
    """Report a value only when it differs by more than `band` from the last reported one; rebuild
    by straight lines.

    As plant historians do, the value just before an exception is reported too, so that a sudden
    change stays sudden.
    """
    n = x.size
    out = x.copy()
    last = 0
    for k in range(1, n):
        if abs(x[k] - x[last]) > band or k == n - 1:
            for i in range(last + 1, k - 1):
                out[i] = x[last] + (x[k - 1] - x[last]) * (i - last) / (k - 1 - last)
            last = k
    return out


def lattice(x: np.ndarray, step: float) -> np.ndarray:
    """Return `x` rounded to multiples of `step`; step 0 leaves it alone."""
    return x if step == 0.0 else np.round(x / step) * step


def printed(x: np.ndarray, style: str, places: int) -> np.ndarray:
    """Return `x` as the archive prints it: `places` significant digits, or `places` decimals."""
    if style == "decimals":
        return np.round(x, places)
    with np.errstate(divide="ignore"):
        power = np.where(x == 0.0, 0.0, places - 1 - np.floor(np.log10(np.abs(x))))
    # scaling both ways by a positive power of ten gives the nearest double to the printed number
    up, down = 10.0 ** np.maximum(power, 0.0), 10.0 ** np.maximum(-power, 0.0)
    return np.round(x * up / down) / up * down


def places_for(resolution: float, centre: float, style: str) -> int:
    """Return the fewest digits (3 to 8) or decimals that print numbers near `centre` finer than
    `resolution`.
    """
    decimals = int(np.ceil(-np.log10(resolution)))
    if style == "decimals":
        return max(decimals, 0)
    leading = int(np.floor(np.log10(max(abs(centre), resolution)))) + 1
    return int(np.clip(leading + decimals, 3, 8))
