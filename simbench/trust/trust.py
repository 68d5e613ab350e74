"""`simbench trust`: which detector is most reliable on one loop, and which stiction its record
could have shown.

The loop is simulated many times with a healthy and with a sticky valve; every detector judges these
replicates, for which the right answer is known.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Unpack

import numpy as np
from scipy.special import logit

from simbench.bench.scenario.truth import healthy_twin
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge, refuse_wrong_forms
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.repaired import repair_record
from simbench.detectors.report.report import choose_methods
from simbench.detectors.sources import Methods, RecordSignals, as_plugin, as_record, named_methods
from simbench.detectors.verdict import STICTION, Verdict
from simbench.gap.closed_loop.gap import describe_gap, within_reach
from simbench.gap.diagnosis import diagnose_all
from simbench.gap.stiction.candidate_loops import CandidateLoops, candidate_loops, loops_of
from simbench.gap.stiction.conclusion import Conclusion, at_rest, from_record
from simbench.gap.stiction.friction import in_percent, refuse_unweighable, stands
from simbench.loop.resolve import friction
from simbench.scenarios.spec import Loop, load_loop
from simbench.trust.power import (
    Cell,
    Rule,
    cannot_tell_apart,
    cells_of,
    likelihood_ratio,
    range_of_visible,
    readings,
    smallest_visible,
)
from simbench.trust.remedies import Remedy, remedies
from simbench.trust.replicates import Replicate, draw_replicates, judged
from simbench.trust.result import MethodTrust, Trust, likelier_verdict

if TYPE_CHECKING:
    from simbench.detectors.sources import Source

_HEALTHY, _EACH = 80, 12  # replicates with a sound valve, and in every cell of S and J
LONG_RECORD, _THINNEST = (
    8000,
    0.3,
)  # samples of a record from which fewer replicates are drawn, and at least this share of them
FEW, _FEWEST_OF_LONG = (
    10,
    16,
)  # fewest replicates of a kind for a conclusion, and drawn of a long record: loops may run away


def trust(
    record: Source | None = None,
    loop: Loop | str | Path | None = None,
    methods: Methods = "all",
    *,
    healthy: int = _HEALTHY,
    each: int = _EACH,
    help_wanted: bool = True,
    seed: int = 0,
    jobs: int = 1,
    **signals: Unpack[RecordSignals],
) -> Trust:
    """Return which detector is most reliable on this loop, which stiction its record could have
    shown, and how probable stiction is.

    Parameters
    ----------
    record : LoopRecord, run, DataFrame, mapping, str or Path
        SP, OP, PV and, where recorded, MV, as `simbench.detect` takes them.
    loop : Loop, str or Path, optional
        The loop, or its loop file, where it is known; otherwise it is identified from the record.
    methods : str, function, object with `detect`, or iterable of them
        Method ids, "all", "fast" or "full", and detectors of the caller, as in `simbench.detect`.
    healthy, each : int
        Number of simulated replicates with a healthy valve, and with each pair of S and J.
    help_wanted : bool
        Simulate what would help where the record shows too little.
    seed : int
        Root of every random stream.
    jobs : int
        Worker processes that judge the replicates, -1 for one on every core; the answer is the
        same. Detectors of the caller are asked in this process.
    **signals
        op, pv, sp, mv, Ts in place of a record, and what is known of it, as in `simbench.detect`.

    Returns
    -------
    Trust
        The conclusion, each method's accuracy on simulated replicates of the loop, and what its
        record could show.

    Raises
    ------
    simbench.detectors.errors.UserError
        For an unknown method, or a loop file of another sampling than the record.

    Notes
    -----
    The conclusion is that of `simbench.gap.stiction`, the same in every verb. The verdicts of the
    methods do not change it: where the limit cycle is smaller than the load disturbances, most
    methods see nothing, and the likelihood still tells. The replicates show which of the methods
    that agree with the conclusion is most accurate here, and how much friction it detects.

    The replicates are only as good as the identified loop: if the loop changed within the record,
    or the plant is unlike first order with dead time, the claims are too sure. The prior
    probability of stiction is one half.

    Examples
    --------
    >>> from simbench.detectors.example_loop import example_loop
    >>> record = example_loop(noise=0.1)
    >>> trusted = trust(record, methods=["fast"], healthy=20, each=4, help_wanted=False)
    >>> 0.0 <= trusted.probability <= 1.0
    True
    """
    asked, user_defined = named_methods(methods)
    with registry.adopted(
        {name: as_plugin(name, detector) for name, detector in user_defined.items()}
    ):
        return _trust(
            as_record(record, **signals),
            load_loop(loop) if isinstance(loop, (str, Path)) else loop,
            choose_methods(asked),
            _Effort(healthy, each, help_wanted, seed, 1 if user_defined else jobs),
        )


class _Effort(NamedTuple):
    """What is simulated, and by how many worker processes it is judged; as in `trust`."""

    healthy: int
    each: int
    help_wanted: bool
    seed: int
    jobs: int


def _trust(record: LoopRecord, loop: Loop | None, names: list[str], effort: _Effort) -> Trust:
    refuse_wrong_forms(names)
    # with a loop file, outliers and a frozen sensor are effects that the diagnosis weighs
    record = repair_record(record) if loop is None else record
    verdicts = judge(record, names)
    prepared = Prepared(replace(record, mv=None))
    try:
        refuse_unweighable(record)
    except UserError as why:
        return _without_replicates(record, verdicts, str(why), from_record(prepared, str(why))[0])
    try:
        if loop is None:
            candidates = candidate_loops(record)
            moves = not stands(record)
            conclusion = from_record(prepared, candidates)[0] if moves else at_rest(record)
        else:
            conclusion, candidates = _with_loop(record, loop)
    except UserError as why:
        if loop is not None:
            raise
        return _without_replicates(record, verdicts, str(why), from_record(prepared, str(why))[0])
    share = float(np.clip(LONG_RECORD / record.n, _THINNEST, 1.0))
    sound = max(round(share * effort.healthy), min(effort.healthy, _FEWEST_OF_LONG))
    replicates = draw_replicates(
        candidates, sound, max(round(share * effort.each), 2), seed=effort.seed
    )
    sticky = np.array([t.S > 0 for t in replicates], dtype=bool)
    if min(sticky.sum(), (~sticky).sum()) < FEW:
        whose = "loop file's" if candidates.trusted else "identified"
        why = (
            f"what could have been seen is unknown: the {whose} loop does not move as the record"
            " does"
        )
        return _without_replicates(record, verdicts, why, conclusion, candidates)
    return _weighed(record, conclusion, candidates, names, verdicts, replicates, effort)


def _with_loop(record: LoopRecord, loop: Loop) -> tuple[Conclusion, CandidateLoops]:
    """Return the conclusion of the whole diagnosis with a loop file, and the loops to replicate."""
    percent = in_percent(record)[0]
    diagnosis = diagnose_all([percent], loop)
    p, found, stated = diagnosis.conclusion.probability, diagnosis.behind.found, friction(loop)
    if stated:
        # replicates of a valve with friction begin from a sound one, which is fitted anew
        found = diagnose_all([percent], healthy_twin(loop)).behind.found
    candidates = loops_of(record, found, float(logit(0.5 if p is None else p)))
    if not stated:
        return diagnosis.conclusion, candidates
    said = "the loop file's valve has friction; twins are drawn with and without it"
    return diagnosis.conclusion, replace(candidates, notes=(said, *candidates.notes))


def _weighed(
    record: LoopRecord,
    conclusion: Conclusion,
    candidates: CandidateLoops,
    names: list[str],
    verdicts_here: list[Verdict],
    replicates: list[Replicate],
    effort: _Effort,
) -> Trust:
    S, J = (np.array([getattr(t, k) for t in replicates]) for k in "SJ")
    sticky = S > 0
    verdicts = judged(replicates, names, effort.jobs)
    of = [[row[i] for row in verdicts] for i in range(len(names))]
    rules = [readings(name, v, sticky) for name, v in zip(names, of)]
    # a method made for other loops is no guide however well it did
    made = [v.applicable is not False for v in verdicts_here]
    keenest = max(range(len(names)), key=lambda i: (made[i], rules[i][0].right))
    shown = cells_of(S, J, np.array([rules[keenest][0].calls(v) for v in of[keenest]]))
    # nor is a reading that contradicts what is more probable here
    wanted = likelier_verdict(conclusion.probability or 0.0)
    read = [
        next((r for r in rules[i] if r.verdict_of(verdicts_here[i]) == wanted), rules[i][0])
        for i in range(len(names))
    ]
    rows = [_row(verdicts_here[i], read[i], of[i], S, J) for i in range(len(names))]
    rows.sort(
        key=lambda m: (m.verdict.applicable is False, m.verdict_here != wanted, -m.rule.right)
    )
    seen, ends = smallest_visible(shown), range_of_visible(shown, effort.seed)
    helps: tuple[Remedy, ...] = ()
    if effort.help_wanted and conclusion.verdict != STICTION:
        helps = remedies(
            candidates,
            names,
            _invisible(shown, seen),
            candidates.percent,
            record.S_unit,
            effort.seed,
            effort.jobs,
        )
    scaled = tuple(_in_units(c, candidates.percent) for c in shown)
    rows = [
        replace(m, power=tuple(_in_units(c, candidates.percent) for c in m.power)) for m in rows
    ]
    near = candidates.nearness()
    far = _far(near)
    return Trust(
        conclusion=conclusion,
        methods=tuple(rows),
        power=scaled,
        twins=tuple((t.S, t.J) for t in replicates),
        helps=helps,
        smallest_visible=(
            None if seen is None else (seen[0] * candidates.percent, seen[1] * candidates.percent)
        ),
        notes=(
            *([f"simulations of this loop are {describe_gap(*near)}"] if near and not far else []),
            *candidates.notes,
        ),
        far=far,
        record=record,
        candidates=candidates,
        most_accurate=rules[keenest][0],
        visible_range=(ends[0] * candidates.percent, ends[1] * candidates.percent),
        rivals=_rivals(rows, sticky),
    )


def _rivals(rows: list[MethodTrust], sticky: np.ndarray) -> tuple[str, ...]:
    """Return the methods that answer here as the first one does, and whose accuracy the replicates
    cannot tell from its.
    """
    first, *others = rows

    def same(m: MethodTrust) -> tuple[bool, str]:
        return m.verdict.applicable is False, m.verdict_here

    return tuple(
        m.rule.method
        for m in others
        if same(m) == same(first) and cannot_tell_apart(first.rule, m.rule, sticky)
    )


def _far(near: tuple[float, float] | None) -> str:
    """Return what is to be known first where the replicates are not near the record."""
    if near is None or within_reach(*near):
        return ""
    return (
        f"the replicates are another loop's: they are {describe_gap(*near)}; what is said of"
        " methods and of the smallest stiction holds for that loop"
    )


def _row(
    verdict: Verdict, rule: Rule, verdicts: list[Verdict], S: np.ndarray, J: np.ndarray
) -> MethodTrust:
    sticky = S > 0
    # what is claimed of a method is claimed of its published rule, the one that gave the verdict
    called = np.array([v.verdict == STICTION for v in verdicts])
    ratio = likelihood_ratio(verdict.verdict, [v.verdict for v in verdicts], sticky)
    return MethodTrust(
        verdict, rule, float(called[~sticky].mean()), tuple(cells_of(S, J, called)), ratio
    )


def _invisible(cells: list[Cell], seen: tuple[float, float] | None) -> tuple[float, float]:
    """Return the largest (S, J) with full slip-jump that does not show, in %; what would help must
    make it visible.
    """
    full = [c for c in cells if c.J >= c.S]
    below = [c for c in full if seen is None or c.S < seen[0]] or full[:1]
    return below[-1].S, below[-1].J


def _in_units(c: Cell, percent: float) -> Cell:
    return c if percent == 1.0 else replace(c, S=c.S * percent, J=c.J * percent)


def _without_replicates(
    record: LoopRecord,
    verdicts: list[Verdict],
    why: str,
    conclusion: Conclusion,
    candidates: CandidateLoops | None = None,
) -> Trust:
    rows = tuple(MethodTrust(v, Rule(v.method, None, 0.5), float("nan"), (), 1.0) for v in verdicts)
    notes = () if candidates is None else candidates.notes
    return Trust(conclusion, rows, None, (), (), (), (why, *notes), record, candidates)
