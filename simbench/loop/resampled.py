"""A load that is drawn again from what a record left: pieces of residuals, put one after the other;
`op`, `input` and `output` are lists of residuals, one a sample, or the columns of these names in
`file`, a CSV file beside the loop file.

The samples within a piece belong together, and so do the columns: pieces of all are taken at the
same places. What enters at `input` or `output` passes 1/`filter` (in falling powers of z) where one
is given, as the residuals of an ARX model do (Ljung 1999, System Identification, section 4.2); `op`
are moves of OP, and the controller goes on from there.

Kunsch (1989), The jackknife and the bootstrap for general stationary observations, Annals of
Statistics 17, 1217: a moving block bootstrap.
When not to use it: pieces as long as a cycle hold the cycle, whatever made it; a third of its
period holds none.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.detectors.signal.filters import lfilter
from simbench.loop.parameters import Number, resolve
from simbench.scenarios.columns import RESIDUALS
from simbench.scenarios.parts import Part
from simbench.scenarios.polynomials import checked_sampled

RESAMPLED = "resampled"
NUMBERS = {
    "piece": Number("s", low=0.0, positive=True, says="length of the pieces"),
    "amplitude": Number("", low=0.0, default=1.0, says="factor on the residuals"),
}
_UNITS = {"op": "changes of OP (%)", "input": "% of travel", "output": "PV units"}


def drawn(
    part: Part, total: int, Ts: float, stream: tuple[int, ...]
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield where the residuals act and the signals, shape (total,), that their pieces make; of
    "op" the moves of OP, sample by sample.
    """
    # The filter, the columns, and the numbers
    where = f"disturbance {RESAMPLED!r}"
    given = dict(part.parameters)
    law = given.pop("filter", None)
    columns = {}
    for name in RESIDUALS:
        if name in given:
            columns[name] = _checked_column(given.pop(name), name, where)
    p = resolve(NUMBERS, given, where)

    # Columns of one length
    lengths = {x.size for x in columns.values()}
    if len(lengths) != 1:
        raise ParameterError(
            f"{where}: " + ("columns of one length are needed" if lengths else "no residuals;")
            + f" file, or {', '.join(f'{n} ({u})' for n, u in _UNITS.items())}, is needed"
        )  # fmt: skip
    (n,) = lengths

    # A piece of at least one sample
    piece = round(p.piece / Ts)
    if not 1 <= piece <= n:
        raise ParameterError(
            f"{where}: piece = {p.piece:g} s is {piece} samples; 1 to {n} are needed, as many as"
            " there are residuals"
        )

    # Pieces drawn with replacement, one behind the other
    rng = np.random.default_rng(stream)
    begins = rng.integers(0, n - piece + 1, -(-total // piece))
    at = (begins[:, None] + np.arange(piece)).ravel()[:total]

    # Each signal through the filter, but for what acts on OP
    for name, column in columns.items():
        signal = p.amplitude * column[at]
        if law is not None and name != "op":
            signal = np.asarray(lfilter([1.0], _filter_denominator(law, where), signal))
        yield name, signal


def _checked_column(values: Any, name: str, where: str) -> np.ndarray:
    try:
        column = np.array(values, dtype=float)
    except (TypeError, ValueError):
        column = np.zeros((0, 0))
    if column.ndim != 1 or column.size < 2 or not np.isfinite(column).all():
        raise ParameterError(f"{where}: {name} is no list of at least 2 numbers, which is needed")
    return column


def _filter_denominator(law: Any, where: str) -> np.ndarray:
    """Return the denominator of a filter, its first number 1."""
    try:
        return _check_law(tuple(law))
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{where}: filter: {error}") from None


@lru_cache(maxsize=16)  # a loop is run with several seeds
def _check_law(law: tuple[float, ...]) -> np.ndarray:
    return checked_sampled([1.0], list(law), 0)[1]
