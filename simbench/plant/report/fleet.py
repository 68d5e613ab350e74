"""Judge the loops of a plant: probability and size of stiction, shared oscillations, and the rank
of each loop.
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.faults import sentence_of
from simbench.detectors.judge import judge
from simbench.detectors.prepared import Prepared
from simbench.detectors.quality import resolution
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_folder, read_labels
from simbench.detectors.records.tables import read_table
from simbench.detectors.report.report import choose_methods
from simbench.detectors.verdict import STICTION, Verdict
from simbench.files import folder as folder_made
from simbench.gap.stiction.causes import (
    NEIGHBOUR,
    NO_CAUSE,
    NOT_TOLD,
    SENSOR,
    STICKING,
    TIGHT,
    Cause,
    Causes,
)
from simbench.gap.stiction.conclusion import Conclusion, from_record
from simbench.gap.stiction.probability import CLAIMED_FROM, pooled, probability
from simbench.plant.episodes import OverTime
from simbench.plant.report.advice import VALVE, Advice, advise
from simbench.plant.report.cost import Cost, cost_of
from simbench.plant.report.events import cascades, likely_root, shared_oscillations
from simbench.plant.report.what_if import Action, what_if
from simbench.plant.resumed import resumed
from simbench.plant.trust.result import Trust
from simbench.plant.trust.trust import trust

# ends the name of the folder next to a page in which the answers on its loops are kept
JUDGED = ".judged"
HEALTHY, EACH = 16, 2  # replicates per loop: enough to rank a plant; `simbench trust` draws more
# of a loop's own cost, where another drives it, and confidence where no cause is named
_FOLLOWER, _OPEN = 0.2, 0.3
# rows, sentences of each kind, and loops with advice that a terminal shows; the page has everything
_LISTED, _SENTENCES, _ADVISED = 15, 5, 2
_NOTHING = "procedure"  # whose windows are missing where a record cannot be judged
_NONLINEAR = "surrogate"  # whose score tells a source from its victims


@dataclass(frozen=True, eq=False)
class FleetLoop:
    """One loop of a plant: conclusion, verdicts, cause, cost and advice.

    `size` (S and J, in the record's unit) is given where stiction is the likelier; `event` numbers
    the oscillation it shares, from 1, with its likely `root`; `pooled` is the probability of
    stiction from all records of the loop; `priority` the share of PV's variance that its cause
    costs, summed over the loops that swing with it, times its confidence.
    """

    name: str
    trust: Trust
    conclusion: Conclusion
    verdicts: tuple[Verdict, ...]
    over_time: OverTime
    size: tuple[float, float] | None
    label: str
    event: int | None
    root: str | None
    advice: Advice
    cost: Cost
    pooled: float | None = None
    causes: Causes | None = None
    actions: tuple[Action, ...] = ()
    priority: float = 0.0
    status: str = ""

    @property
    def cause(self) -> Cause:
        """The cause named, or "cannot tell"."""
        return Cause(NOT_TOLD, 0.0) if self.causes is None else self.causes.named

    @property
    def probability(self) -> float:
        """Probability of stiction; a record that cannot be judged ranks last."""
        return -1.0 if self.trust.probability is None else self.trust.probability


@dataclass(frozen=True, eq=False)
class Fleet:
    """The loops of a plant, the most urgent first; `events` are shared oscillations (likely root
    first), `cascades` pairs of outer and inner loop.
    """

    members: tuple[FleetLoop, ...]
    events: tuple[tuple[str, ...], ...]
    refused: Mapping[str, str]
    methods: tuple[str, ...]
    cascades: tuple[tuple[str, str], ...] = ()

    def to_test(self) -> list[str]:
        """Return the fewest valves to test: one per shared oscillation (its likely root), and each
        loop that oscillates alone.
        """
        followers = {name for event in self.events for name in event[1:]}
        inner = dict(self.cascades)
        asked = [m for m in self.members if m.advice.job == VALVE and m.name not in followers]
        return list(
            dict.fromkeys(
                inner.get(m.name, m.name) if m.cause.name == NOT_TOLD else m.name for m in asked
            )
        )

    def shared(self) -> list[str]:
        """Return one sentence per shared oscillation, with its likely root, and one per cascade."""
        p = {m.name: m.probability for m in self.members}
        lines = []
        for i, event in enumerate(self.events, 1):
            root = event[0]
            why = (
                f"probability of stiction {p[root]:.2f}"
                if p[root] >= 0.5
                else "its PV is the least like a sine"
            )
            lines.append(
                f"Oscillation {i}: {', '.join(event)} share one period; likely root {root} ({why})."
            )
        return lines + [
            f"Cascade: the output of {a} is the set point of {b}; see to {b} first."
            for a, b in self.cascades
        ]

    def as_text(self) -> str:
        """Return what to do first for people: `_LISTED` loops in a table, then shared oscillations
        and records that were left out.
        """
        tests = self.to_test()
        lines = [
            f"Test {len(tests)} of {len(self.members)} valves first: {_some(tests)}."
            if tests
            else f"None of the {len(self.members)} valves needs a test first.",
            "",
            f"{'rank':<4} {'loop':<34} {'P(stiction)':>11} {'S':>5}  {'likely cause':<24} work on",
        ]
        for rank, m in enumerate(self.members[:_LISTED], 1):
            p = "" if m.trust.probability is None else f"{m.probability:.2f}"
            S = "" if m.size is None else f"{m.size[0]:.2g}"
            lines.append(
                f"{rank:<4} {_short(m.name):<34} {p:>11} {S:>5}  {m.cause.name:<24} {m.advice.job}"
            )
        hidden = len(self.members) - _LISTED
        lines += [f"{hidden} more loops are on the page and in the table."] if hidden > 0 else []
        lines += [
            "P(stiction): probability that the valve has stiction. S: estimated stick band (% of"
            " travel where the span of OP is known, else in units of OP; blank: not estimated).",
            "",
            *(f"Next for {m.name}: {m.advice.do}." for m in self.members[:_ADVISED]),
        ]
        lines += self.shared()[:_SENTENCES]
        if self.refused:
            lines.append(f"{len(self.refused)} records were left out; the page names them all:")
        return "\n".join(
            [*lines, *(f"left out {n}: {why}" for n, why in [*self.refused.items()][:_SENTENCES])]
        )


def _short(name: str) -> str:
    """Return a name in 34 columns; tags differ at either end, so what is left out is the middle."""
    return name if len(name) <= 34 else f"{name[:15]}...{name[-16:]}"


def _some(names: Sequence[str]) -> str:
    """Return the first names and how many more there are."""
    more = len(names) - _SENTENCES
    return ", ".join(names[:_SENTENCES]) + (f" and {more} more" if more > 0 else "")


def survey(
    folder: str | Path,
    labels: str | Path | None = None,
    *,
    jobs: int = 2,
    keep: str | Path | None = None,
    previous: str | Path | None = None,
    **about: Any,
) -> Fleet:
    """Judge every record of a folder, find what they share, and rank them."""
    known = {} if labels is None else read_labels(labels)
    before = {} if previous is None else _causes_before(previous)
    if previous is not None and keep is not None:
        _adopt(Path(previous), folder_made(keep))
    each = {name: {"kind": row["kind"], "process": row["process"]} for name, row in known.items()}
    records, refused = read_folder(folder, names=known or None, each=each, **about)
    names = choose_methods(["all"])
    asked = [(name, r, names, known.get(name, {}).get("label", "")) for name, r in records.items()]
    answers = dict(
        zip(records, resumed(_one, asked, jobs=jobs, keep=keep, what="loops"), strict=True)
    )
    refused = {**refused, **{name: why for name, why in answers.items() if isinstance(why, str)}}
    members: list[FleetLoop] = [m for m in answers.values() if not isinstance(m, str)]
    # one copy of each record, not those that came from a file or another process
    members = [replace(m, trust=replace(m.trust, record=records[m.name])) for m in members]
    members = _with_pooled(members, {name: row["loop"] for name, row in known.items()})
    # with the time of the calendar
    timed = {m.name: replace(records[m.name], mv=None) for m in members}
    pairs = cascades(timed)
    members, events = _joined(
        members, {name: Prepared(record) for name, record in timed.items()}, pairs
    )
    members = [replace(m, status=_status(m, before)) for m in members]
    members.sort(
        key=lambda m: (
            -round(m.priority, 2),
            -round(m.probability, 1),
            -(m.size or (0.0, 0.0))[0],
            m.name,
        )
    )
    return Fleet(tuple(members), events, refused, tuple(names), tuple(pairs))


def _causes_before(previous: str | Path) -> dict[str, str]:
    """Return the causes that the tables of an earlier report's folder name, by loop."""
    causes: dict[str, str] = {}
    if not Path(previous).is_dir():
        raise ParameterError(
            f"--previous {previous}: the folder of an earlier report's page and table is needed"
        )
    for file in sorted(Path(previous).glob("*.csv")):
        with contextlib.suppress(UserError):
            columns = read_table(file)
            if {"loop", "cause"} <= set(columns):
                causes |= dict(
                    zip(map(str, columns["loop"]), map(str, columns["cause"]), strict=True)
                )
    if not causes:
        raise ParameterError(
            f"--previous {previous}: no table of an earlier report in it; the .csv next to its page"
            " is needed"
        )
    return causes


def _adopt(previous: Path, keep: Path) -> None:
    """Copy the answers of an earlier report to those of this one, which asks again where a record
    or setting differs.
    """
    for file in previous.glob(f"*{JUDGED}/*.json"):
        if not (keep / file.name).exists():
            with contextlib.suppress(OSError):  # what cannot be read is judged anew
                shutil.copyfile(file, keep / file.name)


def _status(m: FleetLoop, before: Mapping[str, str]) -> str:
    if m.cause.name in (NOT_TOLD, NO_CAUSE):
        return ""
    return "again" if before.get(m.name) == m.cause.name else "new, watch"


def _one(name: str, record: LoopRecord, methods: list[str], label: str) -> FleetLoop | str:
    """Return what is known of a loop, or the sentence of an error, which ends no other loop's."""
    try:
        return _fleet_loop(name, record, methods, label)
    except Exception as error:
        return sentence_of(error)


def _fleet_loop(name: str, record: LoopRecord, methods: list[str], label: str) -> FleetLoop:
    judged = trust(record, methods=["fast"], healthy=HEALTHY, each=EACH, help_wanted=False)
    asked = {m.verdict.method: m.verdict for m in judged.methods}
    others = judge(record, [name for name in methods if name not in asked])
    by_method = asked | {v.method: v for v in others}
    verdicts = tuple(by_method[name] for name in methods)
    size = None
    candidates = judged.candidates
    cost = cost_of(Prepared(record.without_mv()), record)
    actions = what_if(candidates) if candidates is not None else ()
    if (
        candidates is not None
        and candidates.fitted
        and candidates.gain > 0
        and candidates.probability >= 0.5
    ):
        size = (
            candidates.fitted[0] * candidates.percent,
            candidates.fitted[1] * candidates.percent,
        )
        hidden, _ = resolution(record, Prepared(record.without_mv()).flags)
        # an archive that leaves out as much gives no size
        size = None if hidden > 0.5 * size[0] else size
    when = judged.over_time or OverTime(_NOTHING, (), 0, 0)
    return FleetLoop(
        name,
        judged,
        judged.conclusion,
        verdicts,
        when,
        size,
        label,
        None,
        None,
        Advice("", ""),
        cost,
        actions=actions,
    )


def _with_pooled(members: list[FleetLoop], loops: Mapping[str, str]) -> list[FleetLoop]:
    """Return the members with what the records of one loop say together."""
    odds: dict[str, list[float]] = {}
    for m in members:
        if m.trust.candidates is not None:
            odds.setdefault(loops.get(m.name, m.name), []).append(m.trust.candidates.log_odds)
    together = {name: probability(pooled(every)) for name, every in odds.items()}
    return [replace(m, pooled=together.get(loops.get(m.name, m.name))) for m in members]


def _nonlinearity(verdicts: tuple[Verdict, ...]) -> float:
    return next((v.score for v in verdicts if v.method == _NONLINEAR and v.score == v.score), 0.0)


def _joined(
    members: list[FleetLoop], prepared: Mapping[str, Prepared], pairs: Sequence[tuple[str, str]]
) -> tuple[list[FleetLoop], tuple[tuple[str, ...], ...]]:
    """Return the members with their events, causes, priorities and what to do next, and the
    events.
    """
    probability = {m.name: m.probability for m in members}
    nonlinear = {m.name: _nonlinearity(m.verdicts) for m in members}
    events = [tuple(likely_root(g, probability, nonlinear)) for g in shared_oscillations(prepared)]
    # of two as surely sticky loops of a cascade the inner one has the valve
    slaves = {a: b for a, b in pairs if probability[b] > CLAIMED_FROM}
    events = [(b, *(x for x in e if x != b)) if (b := slaves.get(e[0])) in e else e for e in events]
    place = {name: (i, event[0]) for i, event in enumerate(events, 1) for name in event}
    inner = dict(pairs)
    out = []
    for m in members:
        number, root = place.get(m.name, (None, None))
        # a loop as surely sticky as its root is a separate case
        driven = (
            root if root not in (None, m.name) and m.trust.conclusion.verdict != STICTION else None
        )
        # a cascade's outer loop swings with its inner one, whose valve it is
        slave = inner.get(m.name)
        if (
            slave is not None
            and probability[slave] > CLAIMED_FROM
            and prepared[m.name].oscillation.sustained
        ):
            driven = slave
        evidence = m.trust.candidates or m.trust.conclusion.reason
        concluded, causes = from_record(
            prepared[m.name], evidence, driven, probability.get(driven or "", 0.0)
        )
        # on a loop whose cause nobody knows an action is no advice
        actions = m.actions if causes.named.name in (STICKING, TIGHT) else ()
        advice = advise(concluded, prepared[m.name], causes.named, driven, actions)
        out.append(
            replace(
                m,
                conclusion=concluded,
                event=number,
                root=root,
                causes=causes,
                advice=advice,
                actions=actions,
            )
        )
    shares = {m.name: _costs(m) for m in out}
    followers = {event[0]: event[1:] for event in events}
    priced = []
    for m in out:
        both = shares[m.name] + sum(shares[name] for name in followers.get(m.name, ()))
        if m.cause.name == NEIGHBOUR:
            both *= _FOLLOWER
        priced.append(
            replace(m, priority=both * (_OPEN if m.cause.name == NOT_TOLD else m.cause.confidence))
        )
    return priced, tuple(events)


def _costs(m: FleetLoop) -> float:
    """Return the share of PV's variance that a loop's cause takes; without a measurement that can
    be trusted, all of it.
    """
    if m.cause.name == NO_CAUSE:
        return 0.0
    if m.cause.name == SENSOR:
        return 1.0
    return max(m.cost.pv_share, m.cost.saturated)
