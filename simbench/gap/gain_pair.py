"""Judge a change of controller gain that was recorded: the loop is identified from both records,
and simulated with a sound valve and with friction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from simbench.confirm.expected import (
    Phase,
    expect_change,
    kept,
    measure,
    odds_of_friction,
    with_friction,
)
from simbench.confirm.gain_change import (
    TOLD_FROM,
    GainChange,
    describe_change,
    judge_change,
    shift_of,
    unfit,
)
from simbench.confirm.recorded import controller_gain, travel_recorded
from simbench.confirm.rig import Trace
from simbench.confirm.travel import TravelTest
from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.sources import About, RecordSignals, as_record
from simbench.gap.stiction.candidate_loops import candidate_loops
from simbench.gap.stiction.probability import pool_log_odds, probability

if TYPE_CHECKING:
    from simbench.detectors.sources import Source


def gain_change_recorded(
    before: LoopRecord, after: LoopRecord, factor: float | None = None
) -> GainChange:
    """Judge a change of controller gain from a record before it and one after it.

    The change is weighed by simulations, as in `gain_change`, of the loops that are identified from
    either record; what each record shows of friction by itself counts as well.
    """
    # One sampling period
    if not np.isclose(before.Ts, after.Ts):
        raise ParameterError(
            f"gain change: Ts = {before.Ts:g} s before and {after.Ts:g} s after; one is needed for"
            " both"
        )

    # The gains are stated, or read off both records
    if factor is not None:
        gains = (1.0, factor)
    else:
        gains = (controller_gain(before), controller_gain(after))
    if gains[0] is None or gains[1] is None:
        raise ParameterError(
            "gain change: the records do not show the controller gain; new over old is needed:"
            " --ratio"
        )

    # A change that is large enough to tell anything
    if gains[0] > 0:
        ratio = gains[1] / gains[0]
    else:
        ratio = np.nan
    if not (0.0 < ratio < np.inf and abs(ratio - 1.0) >= 0.2):
        raise ParameterError(
            f"gain change: Kc changed {ratio:.3g}-fold; at least 20 % more or less is needed"
        )

    # What each record does, and how the two differ
    records = (before, after)
    signals = [r.op if r.op_percent is None else r.op_percent for r in records]
    phases = [measure(op, r.Ts, float(Kc)) for op, r, Kc in zip(signals, records, gains)]
    verdict, reason = _compare_records(records, phases, ratio)

    # Both records in one trace
    op = np.concatenate(signals)
    pv = np.concatenate([before.pv, after.pv])
    trace = Trace(op, pv, np.full(op.size, np.nan))
    shift = shift_of(*phases)
    return GainChange(verdict, reason, *phases, shift, 0.0, before.Ts, before.n, trace)


def _compare_records(
    records: tuple[LoopRecord, LoopRecord], phases: list[Phase], ratio: float
) -> tuple[str, str]:
    """Return verdict and reason of two records."""
    # Two phases that can be compared, and a loop for each
    why = unfit(*phases)
    if why:
        return "no_decision", why
    try:
        loops = [candidate_loops(record.without_mv()) for record in records]
    except UserError as error:
        what = describe_change(*phases)
        return "no_decision", f"{what}; what a sound valve would do is unknown: {error}"

    # a loop identified after the change has the new gain already
    factors = ((1.0, ratio), (1.0 / ratio, 1.0))
    sound = [(one.alone, 0.0, f) for one, f in zip(loops, factors)]
    sticky = []
    for one, phase, f in zip(loops, phases, factors):
        for stuck, kick in with_friction(one.alone, phase.amplitude / one.percent):
            sticky.append((stuck, kick, f))

    # What either kind of valve would have done
    lengths = (records[0].n, records[1].n)
    Ts = records[0].Ts
    expectations = [expect_change(some, lengths, Ts) for some in (sound, sticky)]
    odds = odds_of_friction(*phases, *expectations, outside=True)
    shown = pool_log_odds([one.log_odds for one in loops])
    outside = kept(*phases)
    near = outside or any(one.near(*phases) for one in expectations)
    verdict, reason = judge_change(odds, describe_change(*phases), *expectations, near)

    # No confirmation by what was known before
    alone = f"by themselves the records show stiction with probability {probability(shown):.2f}"
    alike = expectations[0].alike(expectations[1]) and not outside
    if not near or alike:
        # what the records show by themselves is no confirmation
        verdict = "no_decision"
    # the change may contradict what the records show, and take a side where they lean to it
    elif shown > TOLD_FROM:
        verdict = "no_decision" if verdict == "no_stiction" else "stiction"
    elif verdict == "stiction" or shown > 0.0:
        verdict = "no_decision"
    return verdict, f"{reason}; {alone}"


@overload
def confirm(record: Source, **signals: Unpack[RecordSignals]) -> TravelTest: ...
@overload
def confirm(
    record: Source, after: Source, *, ratio: float | None = None, **signals: Unpack[RecordSignals]
) -> GainChange: ...
@overload
def confirm(
    *, op: ArrayLike, pv: ArrayLike, Ts: float, sp: ArrayLike | None = None, **about: Unpack[About]
) -> TravelTest: ...
def confirm(
    record: Source | None = None,
    after: Source | None = None,
    *,
    ratio: float | None = None,
    **signals: Any,
) -> TravelTest | GainChange:
    """Is it the valve? Judge the record of a travel test, or the records before and after a change
    of controller gain.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str or Path
        Of a travel test, or from before the change of gain; SP, OP, PV as `simbench.detect` takes
        them.
    after : LoopRecord, run, DataFrame, mapping, str or Path, optional
        From after the change of gain.
    ratio : float, optional
        Controller gain after over before; read off the records where it is not given.
    **signals
        op, pv, sp, mv, Ts in place of one record, and what is known of both, as in
        `simbench.detect`.

    Returns
    -------
    TravelTest or GainChange
        The valve's travel test, or of two records the change of amplitude and period;
        either has a verdict.

    Raises
    ------
    RecordError
        For what is no record, or two of different sampling.

    Examples
    --------
    >>> t = np.arange(2000.0)
    >>> turns = (2 * np.pi * t / P for P in (90, 150))
    >>> one, two = ({"t": t, "op": 50 + np.sin(x), "pv": np.cos(x)} for x in turns)
    >>> round(confirm(one, two, ratio=0.6).shift, 2)
    0.67
    """
    first = as_record(record, **signals)
    if after is None:
        if ratio is not None:
            raise ParameterError(
                f"ratio = {ratio:g} without a second record; confirm(before, after,"
                f" ratio={ratio:g}) is needed"
            )
        return travel_recorded(first)
    return gain_change_recorded(first, as_record(after, **signals), ratio)
