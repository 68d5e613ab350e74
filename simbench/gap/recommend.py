"""Recommend which test to run next on a loop: diagnose its record, then size what is left to ask
(`simbench gap plan`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from simbench.detectors.compiled import one_thread
from simbench.gap.diagnosis import diagnose
from simbench.gap.planning import order
from simbench.gap.planning.menu import Limits
from simbench.gap.planning.order import PlannedTests
from simbench.gap.report.result import GapReport
from simbench.loop.effects import UNKNOWN
from simbench.scenarios.toml import read_toml
from simbench.scenarios.toml_table import checked

if TYPE_CHECKING:
    from simbench.detectors.sources import RecordSignals, Source
    from simbench.gap.intake.partial import Partial
    from simbench.gap.intake.recorded_test import RecordedTest
    from simbench.scenarios.spec import Loop


def plan(
    record: Source | Sequence[Source] | None = None,
    baseline: Loop | Partial | str | Path | None = None,
    *,
    identify: bool = False,
    tests: Sequence[RecordedTest] = (),
    healthy: Sequence[Source] = (),
    limits: Mapping[str, Any] | str | Path | None = None,
    **signals: Unpack[RecordSignals],
) -> PlannedTests:
    """Recommend the next tests on the plant, with their size, duration and effect on PV and OP.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str, Path, or sequence of them
        What is not explained yet, as `simbench.gap.diagnose` takes it.
    baseline : Loop, Partial, str, Path or None
        The simulation, or its loop file.
    identify : bool
        Identify plant and tuning from the record, as without a baseline.
    tests : sequence of RecordedTest
        Tests of the same loop that were run already.
    healthy : sequence of LoopRecord, run, DataFrame, mapping, str or Path
        Records from healthy operation.
    limits : mapping, str, Path or None
        What a test may do, or a TOML file of it: pv and op (ranges, PV units and %), pv_excursion,
        op_travel (how far each may move), minutes. None sets no limit but the travel of OP.
    **signals
        op, pv, sp, mv, Ts in place of a record, and what is known of it, as in `simbench.detect`.

    Returns
    -------
    PlannedTests
        `tests`, in the order in which they are recommended, or `why` none is.

    Raises
    ------
    simbench.detectors.errors.UserError
        In one sentence, when record and baseline cannot be compared, or for limits that are none.

    Examples
    --------
    >>> import simbench as sb
    >>> loop = sb.Loop(
    ...     plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
    ...     controller={"type": "PI", "Kc": 1, "Ti": 10},
    ...     sampling={"Ts": 1, "n": 800},
    ...     noise={"std": 0.1},
    ... )
    >>> plan(loop.simulate(1).record.without_mv(), loop).tests[0].id
    'mv'
    """
    within = limits_of(limits)
    found = diagnose(record, baseline, identify=identify, tests=tests, healthy=healthy, **signals)
    return plan_of(found, within)


def limits_of(given: Mapping[str, Any] | str | Path | None) -> Limits:
    """Return the limits of a test from a table or a TOML file of them."""
    if given is None:
        return Limits()
    table, where = (
        (dict(given), "limits") if isinstance(given, Mapping) else (read_toml(given), str(given))
    )
    return checked(Limits, table, where)


def plan_of(report: GapReport, limits: Limits) -> PlannedTests:
    """Return the tests that are left to run after a diagnosis, within limits."""
    probability = {r.effect: r.probability for r in report.ranking}
    with one_thread():
        planned = order.plan(report.behind.found, probability, report.behind.loops, limits)
    return replace(planned, far=_ask_first(report, probability))


def _ask_first(report: GapReport, probability: Mapping[str, float]) -> str:
    """Return what is to be known first where no known effect brings the model near the record."""
    gap = report.gap
    if gap.near:
        return ""
    return (
        f"The model is far from the record, even corrected: its gap is {gap.after:.2f},"
        f" parts of the record are {gap.plant_floor:.2f} apart (unknown:"
        f" {probability.get(UNKNOWN, 0.0):.2f}). A test of a model that is not this loop tells"
        " little: check the loop file first."
    )
