"""Friction weighed against a sound valve by the likelihood of the record: the diagnosis with nothing else asked."""

from __future__ import annotations

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.candidates import beside_the_load, fit_candidates, possible_effects
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.identified import plausible
from simbench.gap.effects import NOT_TRIED, recogniser
from simbench.gap.intake.check import check
from simbench.gap.intake.other_loop import refuse_other_plant
from simbench.gap.intake.partial import completed
from simbench.gap.intake.refuse import refuse_unfit
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import Situation, load_memory
from simbench.loop.effects import EFFECTS

FRICTION = "stiction"  # the effect whose size is asked for
OUTSIDE = "oscillation"  # what swings a sound loop


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
        Friction's gain is the one that a diagnosis of the same record finds, at half its cost.

    Raises
    ------
    detectors.errors.UserError
        In one sentence, when no loop can be identified, or record and loop cannot be compared.

    Examples
    --------
    >>> from simbench.gap.random_case import random_case
    >>> found = friction(random_case(5, ("stiction",)).record)
    >>> found.log_likelihood_gains[FRICTION] > 10
    True
    """
    from threadpoolctl import threadpool_limits

    # thousands of tiny matrices: threads would only wait for each other
    with threadpool_limits(limits=1):
        refuse_unfit(record, f"record {record.tag!r}" if record.tag else "record")
        whole, given, _ = completed(record, loop)
        s = check(record, whole, trusted="plant" in given, tuned="controller" in given)
        # MV is judged beside OP by the whole diagnosis alone
        found = _few(s) if record.mv is None else assess(s)
        return found if s.trusted else plausible(found)


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
