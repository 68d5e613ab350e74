"""A plant's loops, judged side by side: probability and size of stiction, shared oscillations, whose job is next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from detectors.prepared import Prepared
from detectors.record import LoopRecord
from detectors.records.io import read_folder, read_labels
from detectors.report.report import choose_methods
from detectors.verdict import Verdict
from simbench.gap.stiction.probability import pooled, probability
from simbench.plant.episodes import OverTime
from simbench.plant.indices import judged
from simbench.plant.report.advice import Advice, advise
from simbench.plant.report.events import likely_root, shared_oscillations
from simbench.plant.resumed import resumed
from simbench.plant.trust.result import STICKY, Trust
from simbench.plant.trust.trust import trust

HEALTHY, EACH = 16, 2  # twins per loop: enough to rank a plant; `simbench trust` draws more
_NOTHING = "procedure"  # whose windows are missing where a record cannot be judged
_NONLINEAR = "surrogate"  # whose score tells a source from its victims


@dataclass(frozen=True, eq=False)
class FleetLoop:
    """One loop of a plant.

    Parameters
    ----------
    name : str
        Record.
    found : Trust
        From few twins and the fast methods.
    verdicts : tuple of Verdict
        Of all methods on the record.
    over_time : OverTime
    size : (float, float) or None
        S and J where stiction is the likelier, in the record's unit.
    label : str
        "" where none was given.
    event : int or None
        Number of the oscillation it shares, from 1.
    root : str or None
        Likely root of that oscillation; itself where it is the root.
    advice : Advice
    pooled : float or None
        Probability of stiction from all records of this loop.
    """

    name: str
    found: Trust
    verdicts: tuple[Verdict, ...]
    over_time: OverTime
    size: tuple[float, float] | None
    label: str
    event: int | None
    root: str | None
    advice: Advice
    pooled: float | None = None

    @property
    def probability(self) -> float:
        """Of stiction; a record that cannot be judged stands last."""
        return -1.0 if self.found.probability is None else self.found.probability


@dataclass(frozen=True, eq=False)
class Fleet:
    """A plant's loops, the most urgent first.

    Parameters
    ----------
    members : tuple of FleetLoop
        By probability in steps of a tenth, then by S.
    events : tuple of tuple of str
        Loops that share an oscillation, the likely root first.
    refused : dict of str to str
        Files that are no records, each with its sentence.
    methods : tuple of str
    """

    members: tuple[FleetLoop, ...]
    events: tuple[tuple[str, ...], ...]
    refused: Mapping[str, str]
    methods: tuple[str, ...]

    def as_text(self) -> str:
        """Return the ranking for people, one line a loop."""
        head = f"{'rank':<5}{'loop':<34} {'p':>5}  {'S':>6}  {'job':<12} what to do next"
        lines = [head]
        for rank, m in enumerate(self.members, 1):
            p = "" if m.found.probability is None else f"{m.probability:.2f}"
            S = "" if m.size is None else f"{m.size[0]:.2g}"
            lines.append(f"{rank:<5}{m.name:<34} {p:>5}  {S:>6}  {m.advice.job:<12} {m.advice.do}")
        for i, event in enumerate(self.events, 1):
            lines.append(f"oscillation {i}: {', '.join(event)} share one period; likely root {event[0]}")
        return "\n".join([*lines, *(f"left out {n}: {why}" for n, why in self.refused.items())])


def survey(
    folder: str | Path, labels: str | Path | None = None, *, jobs: int = 2, seed: int = 0, keep: str | Path | None = None,
    **about: Any,
) -> Fleet:  # fmt: skip
    """Judge every record of a folder, find what they share, and rank them."""
    known = {} if labels is None else read_labels(labels)
    each = {name: {"kind": row["kind"], "process": row["process"]} for name, row in known.items()}
    records, refused = read_folder(folder, names=known or None, each=each, **about)
    names = choose_methods(["all"])
    asked = [(name, r, names, known.get(name, {}).get("label", ""), seed) for name, r in records.items()]
    members: list[FleetLoop] = resumed(_one, asked, jobs=jobs, keep=keep, what="loops")
    members = _with_pooled(members, {name: row["loop"] for name, row in known.items()})
    members, events = _joined(members, {m.name: Prepared(records[m.name].without_mv()) for m in members})
    members.sort(key=lambda m: (-round(m.probability, 1), -(m.size or (0.0, 0.0))[0], m.name))
    return Fleet(tuple(members), events, refused, tuple(names))


def _one(name: str, record: LoopRecord, methods: list[str], label: str, seed: int) -> FleetLoop:
    found = trust(record, methods=["fast"], healthy=HEALTHY, each=EACH, help_wanted=False, seed=seed)
    asked = {m.verdict.method: m.verdict for m in found.methods}
    others = judged(record, [name for name in methods if name not in asked])
    by_method = asked | {v.method: v for v in others}
    said = tuple(by_method[name] for name in methods)
    size = None
    behind = found.behind
    if behind is not None and behind.fitted and behind.gain > 0 and behind.probability >= 0.5:
        size = (behind.fitted[0] * behind.percent, behind.fitted[1] * behind.percent)
    when = found.over_time or OverTime(_NOTHING, (), 0, 0)
    return FleetLoop(name, found, said, when, size, label, None, None, Advice("", ""))


def _with_pooled(members: list[FleetLoop], loops: Mapping[str, str]) -> list[FleetLoop]:
    """Return the members with what the records of one loop say together."""
    odds: dict[str, list[float]] = {}
    for m in members:
        if m.found.behind is not None:
            odds.setdefault(loops.get(m.name, m.name), []).append(m.found.behind.log_odds)
    together = {name: probability(pooled(every)) for name, every in odds.items()}
    return [replace(m, pooled=together.get(loops.get(m.name, m.name))) for m in members]


def _nonlinearity(verdicts: tuple[Verdict, ...]) -> float:
    return next((v.score for v in verdicts if v.method == _NONLINEAR and v.score == v.score), 0.0)


def _joined(members: list[FleetLoop], prepared: Mapping[str, Prepared]) -> tuple[list[FleetLoop], tuple[tuple[str, ...], ...]]:
    """Return the members with their events and what to do next, and the events."""
    probability = {m.name: m.probability for m in members}
    nonlinear = {m.name: _nonlinearity(m.verdicts) for m in members}
    events = [tuple(likely_root(g, probability, nonlinear)) for g in shared_oscillations(prepared)]
    place = {name: (i, event[0]) for i, event in enumerate(events, 1) for name in event}
    out = []
    for m in members:
        number, root = place.get(m.name, (None, None))
        # a loop as surely sticky as its root is a case of its own
        driven = root if root not in (None, m.name) and m.found.answer != STICKY else None
        out.append(replace(m, event=number, root=root, advice=advise(m.found, prepared[m.name], driven)))
    return out, tuple(events)
