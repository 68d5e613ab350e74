"""Friction weighed against a sound valve by the likelihood of the record: the diagnosis with nothing else asked."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from detectors.errors import UserError
from detectors.record import LoopRecord
from scenarios.spec import Loop, Sampling
from simbench.gap.candidates import beside_the_load, fit_candidates, possible_effects
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.identified import plausible, remarks
from simbench.gap.effects import NOT_TRIED, recogniser
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import exact_controller, identify
from simbench.gap.intake.other_loop import refuse_other_plant
from simbench.gap.intake.partial import completed
from simbench.gap.intake.refuse import refuse_unfit
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import Situation, load_memory
from simbench.gap.stiction.pace import at_its_pace
from simbench.loop.effects import EFFECTS

FRICTION = "stiction"  # the effect whose size is asked for
OUTSIDE = "oscillation"  # what swings a sound loop
ENOUGH = 30.0  # nats beyond which more say nothing more


def friction(record: LoopRecord, loop: Loop | None = None) -> Assessment:
    """Fit a loop to a record with a sound valve, with friction, and with an oscillation from outside.

    Parameters
    ----------
    record : LoopRecord
        With OP in %.
    loop : Loop, optional
        Plant and controller where they are known; identified from the record otherwise.

    Returns
    -------
    Assessment
        Friction's gain is the one that a diagnosis of the record finds, at half its cost; where that leaves doubt and samples
        are closer than the loop moves, that of a diagnosis at the loop's pace if it is larger: between close samples lies what
        no plant of first order describes, between distant ones slips are lost, and with them a part of J. What single samples
        prove is proven by all of them.

    Raises
    ------
    detectors.errors.UserError
        In one sentence, when no loop can be identified, or record and loop cannot be compared.

    Examples
    --------
    >>> from random_case import random_case
    >>> found = friction(random_case(5, ("stiction",)).record)
    >>> found.log_likelihood_gains[FRICTION] > 10
    True
    """
    from threadpoolctl import threadpool_limits

    # thousands of tiny matrices: threads would only wait for each other
    with threadpool_limits(limits=1):
        refuse_unfit(record, f"record {record.tag!r}" if record.tag else "record")
        # a loop that is known is known at its own sampling, and MV shows a slip where it happens
        slow = at_its_pace(record) if loop is None and record.mv is None else record
        if slow is record:
            whole, given, _ = completed(record, loop)
            return _fitted(record, whole, given)
        every = _as_it_is(record)
        if every is not None and every.log_likelihood_gains[FRICTION] >= ENOUGH:
            return every
        own = _at_pace(slow, record)
        if every is None and own is None:
            return _fitted(record, identify(record))
        return max(filter(None, (every, own)), key=lambda f: f.log_likelihood_gains[FRICTION])


def _fitted(record: LoopRecord, loop: Loop, given: Collection[str] = ()) -> Assessment:
    """Return the assessment beside a loop of which plant, controller, or both, or none, were given."""
    s = check(record, loop, trusted="plant" in given, tuned="controller" in given)
    # MV is judged beside OP by the whole diagnosis alone
    found = _few(s) if record.mv is None else assess(s)
    return found if s.trusted else plausible(found)


def _as_it_is(record: LoopRecord) -> Assessment | None:
    """Return the assessment of all samples; None where no loop can be identified from them."""
    try:
        return _fitted(record, identify(record))
    except UserError:
        return None


def _at_pace(slow: LoopRecord, record: LoopRecord) -> Assessment | None:
    """Return the assessment of fewer samples; None where no loop can be identified from them."""
    try:
        return _as_sampled(_fitted(slow, identify(slow, controller=exact_controller(record))), record)
    except UserError:
        return None


def _as_sampled(found: Assessment, record: LoopRecord) -> Assessment:
    """Return the assessment with what single samples of the whole record prove, and what must be known of them."""
    s = found.situation
    own = s.baseline.model_copy(update={"sampling": Sampling(Ts=record.Ts, n=record.n)})
    whole = check(record, own, trusted=False)
    parameters = {e: p for e, p in found.parameters.items() if e not in s.proven} | whole.proven
    said = replace(s, proven=whole.proven, notes=[*whole.notes, *remarks(whole)])
    return replace(found, situation=said, parameters=parameters)


def _few(s: Situation) -> Assessment:
    """Return the assessment of a record without MV in which only friction and what moves like it were tried."""
    if s.trusted and s.tuned:
        refuse_other_plant(s)
    engine = Engine(s.data, load_memory(s))
    # a load that jumps is tried for its own sake by none of the rooms above, but friction must explain more than it does
    tried = [e for e in possible_effects(s) if e in (FRICTION, OUTSIDE) or recogniser(e).ordinary]
    bare = engine.base()
    base, fitted = beside_the_load(engine, bare, fit_candidates(engine, bare, tried))
    gains = dict.fromkeys(EFFECTS, NOT_TRIED) | {e: float(c.log_likelihood_gain) for e, c in fitted.items()}
    parameters = {e: recogniser(e).numbers(c.fit, s) for e, c in fitted.items() if c.used} | s.proven
    return Assessment(s, base, fitted, parameters, [], base, gains)
