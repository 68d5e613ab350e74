"""`Report`: the verdicts of several methods on one or several records, as text, JSON, a data frame
and a score table.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from simbench.detectors.errors import UnknownName
from simbench.detectors.judge import FAILED
from simbench.detectors.plugins.registry import PUBLISHED
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.report import summary
from simbench.detectors.sources import split_names
from simbench.detectors.verdict import NO_DECISION, PROBABILITY, STICTION, Verdict
from simbench.detectors.views import columns, page_part

if TYPE_CHECKING:
    import pandas as pd

    from simbench.detectors.record import LoopRecord

_UNDECIDED = 0.5  # cost of no decision; an error costs 1
_SETS = ("all", "fast", "full", PUBLISHED)


_MOST_LOOPS = 20  # of a folder that a screen shows
_RANKED = ("record", "conclusion", PROBABILITY, "cause", "event", "reason", "next")


class ShownConclusion(Protocol):
    """The conclusion of all evidence about one valve, as `simbench.verbs` adds it."""

    def as_lines(self) -> list[str]:
        """Return verdict with probability and cause, reason, next step."""
        ...

    def as_json(self) -> dict[str, Any]:
        """Return the same in JSON types."""
        ...


@dataclass(frozen=True)
class Report:
    """What was judged and what came out."""

    # record name (None for a single file) and verdict, records and methods in order
    verdicts: list[tuple[str | None, Verdict]]
    # files of a folder that are no records, each with its sentence
    refused: dict[str, str] = field(default_factory=dict)
    # one row per method, when labels were given
    scores: list[dict[str, Any]] = field(default_factory=list)
    # what was judged, by name
    records: dict[str | None, LoopRecord] = field(default_factory=dict, repr=False)
    # the conclusion of all evidence about each record, by name; the methods alone conclude nothing
    conclusions: dict[str | None, ShownConclusion] = field(default_factory=dict, repr=False)
    # the number of the oscillation that a loop of a folder shares with others
    events: dict[str, int] = field(default_factory=dict)

    def as_json(self) -> list[dict[str, Any]]:
        """Return one object per verdict, those of a folder by the rank of the record; `conclusion`
        is the last key where all evidence about the record was weighed.

        Objects of a folder also have `record`, and `event`: the number of the oscillation that the
        loop shares with others, else null. A file that is no record has one object, without a
        method.
        """
        # what stands beside each verdict
        concluded = {}
        for n, c in self.conclusions.items():
            concluded[n] = {"conclusion": c.as_json()}
        place = {}
        for n in self.records:
            if n is None:
                place[n] = {}
            else:
                place[n] = {"record": n, "event": self.events.get(n)}

        # verdicts, then files that are no records
        answers = []
        for name, verdicts, _ in self.groups():
            for v in verdicts:
                answers.append({**place[name], **v.as_json(), **concluded.get(name, {})})
        unread = {"method": None, "applicable": None}
        return answers + [
            {
                "record": name,
                "event": None,
                **Verdict("", NO_DECISION, reason=why).as_json(),
                **unread,
            }
            for name, why in self.refused.items()
        ]

    @property
    def conclusion(self) -> ShownConclusion | None:
        """The conclusion about a single record; None where none was drawn, and of several records,
        whose are in `conclusions`.
        """
        return self.conclusions.get(None)

    @property
    def of_folder(self) -> bool:
        """Whether a folder was judged, or a file of several loops: its records have names."""
        return None not in self.records

    def __repr__(self) -> str:
        """Return one line."""
        sizes = (("verdict", len(self.verdicts)), ("record", len(self.records)))
        text = "Report: " + " on ".join(f"{n} {word}{'s' * (n != 1)}" for word, n in sizes)
        if self.conclusion is not None:
            text += f"; {self.conclusion.as_lines()[0]}"
        return text

    def __len__(self) -> int:
        """Number of verdicts."""
        return len(self.verdicts)

    def __iter__(self) -> Iterator[Verdict]:
        """Walk over the verdicts."""
        return (v for _, v in self.verdicts)

    def __getitem__(self, method: str) -> Verdict:
        """Return the verdict of one method; of several records, the first."""
        by_method = {}
        for _, v in reversed(self.verdicts):
            by_method[v.method] = v
        if method not in by_method:
            raise UnknownName("method", method, by_method, "this report")
        return by_method[method]

    def as_text(self, *, why: bool = False) -> str:
        """Return summary, table and scores for a terminal.

        Parameters
        ----------
        why : bool
            Each method's reason as well.

        Returns
        -------
        str
            One line per verdict, and how many methods said what.
        """
        # what was concluded, and what each method says
        concluded = {}
        for name, conclusion in self.conclusions.items():
            concluded[name] = conclusion.as_lines()
        text = summary.as_text(self.groups(), concluded, why=why)
        if len(self.records) > 1 and self.conclusions:
            text = "\n".join(self._ranked_lines() + ["", text])

        # scores against labels
        if not self.scores:
            return text

        # What no decision and one constant answer cost
        most = max(self.scores, key=lambda row: row["applicable"])
        sticky = most["positives"]
        units = most["applicable"]
        legend = (
            f"cost, which ranks: an error 1, no decision {_UNDECIDED}; of {units} units always no"
            " costs"
        )
        if units:
            legend += f" {sticky / units:.2f}, always yes {1 - sticky / units:.2f}"
        else:
            legend += " nothing"
        return "\n".join([text, ""] + table(self.scores) + [legend])

    def opening(self) -> str:
        """Return the first lines of `as_text`: what was read, and the conclusion about it."""
        [(name, record)] = self.records.items()
        concluded = self.conclusions.get(name)
        return summary.opening(name, record, () if concluded is None else concluded.as_lines())

    def to_frame(self) -> pd.DataFrame:
        """Return one row per verdict.

        Returns
        -------
        DataFrame
            record (for a folder), method, verdict, score, S_lo, S_hi, J_lo, J_hi, S_unit,
            applicable, reason, and the indices.
        """
        return summary.to_frame(self.verdicts)

    def loops(self) -> pd.DataFrame:
        """Return one row per loop of a folder.

        Returns
        -------
        DataFrame
            record, conclusion, probability_of_stiction, cause, event, reason, next, and the verdict
            of each method; ranked by the conclusion, files that are no records last, with the
            reason.
        """
        import pandas as pd

        verdicts = {}
        for name, said, _ in self.groups():
            verdicts[name] = {v.method: v.verdict for v in said}
        rows = [{**row, **verdicts.get(row["record"], {})} for row in self._rank_loops()]
        return pd.DataFrame(rows).astype({"event": "Int64"})

    def _rank_loops(self) -> list[dict[str, Any]]:
        """Return what was concluded of each loop, in the order of `groups`, then why files were
        refused.
        """
        # A row for every loop, in the order of the groups
        rows = []
        for name, _, _ in self.groups():
            if name in self.conclusions:
                c = self.conclusions[name].as_json()
            else:
                c = {}
            of_loop = {"record": name, "conclusion": c.get("verdict")}
            told = {}
            for key in ("cause", "reason", "next"):
                told[key] = c.get(key)
            event = self.events.get(str(name))
            rows.append({**of_loop, PROBABILITY: c.get("probability"), "event": event, **told})

        # Files that hold no record come last, with their reason
        refused = [
            {"record": name, "conclusion": "no record", "reason": why}
            for name, why in self.refused.items()
        ]
        return [{**dict.fromkeys(_RANKED), **row} for row in tuple(rows) + tuple(refused)]

    def _ranked_lines(self) -> list[str]:
        # The most probable loops
        lines = [("loop", "conclusion", "P(stiction)", "cause", "event")]
        more = len(self.conclusions) - _MOST_LOOPS
        for row in self._rank_loops()[: min(len(self.conclusions), _MOST_LOOPS)]:
            if row[PROBABILITY] is None:
                p = ""
            else:
                p = f"{row[PROBABILITY]:.2f}"
            word = summary.CONCLUDED[row["conclusion"]]
            lines.append((row["record"], word, p, row["cause"], str(row["event"] or "")))

        # How many more there are, and which files hold no record
        if more > 0:
            cut = [f"and {more} more loops: --csv FILE"]
        else:
            cut = []
        return columns(lines) + cut + [f"{name}: {why}" for name, why in self.refused.items()]

    def _repr_html_(self) -> str:
        frame = self.to_frame()
        keys = []
        for c in ("record", "method", "verdict", "score", "applicable", "reason"):
            if c in frame:
                keys.append(c)
        groups = self.groups()
        return page_part(
            summary.sentence(groups[0][1]) if len(groups) == 1 else f"{len(groups)} records",
            frame[keys],
        )

    def groups(self) -> list[tuple[str | None, list[Verdict], LoopRecord | None]]:
        """Return the verdicts record by record: name, verdicts, record; where records were weighed,
        the most probable stiction first.
        """
        groups: dict[str | None, list[Verdict]] = {}
        for name, verdict in self.verdicts:
            groups.setdefault(name, []).append(verdict)
        found = [(name, verdicts, self.records.get(name)) for name, verdicts in groups.items()]
        return sorted(found, key=lambda group: -self._probability_or_last(group[0]))

    def _probability_or_last(self, name: str | None) -> float:
        """Return the probability of stiction, below all others where there is none."""
        if name in self.conclusions:
            known = self.conclusions[name].as_json()["probability"]
        else:
            known = None
        return -1.0 if known is None else known


def describe_failures(verdicts: Iterable[tuple[str | None, Verdict]]) -> list[str]:
    """Return one clause per method that gave no verdict where it was asked for one: how often, and
    why first.
    """
    first: dict[str, list[str]] = {}
    for _, verdict in verdicts:
        if verdict.reason.startswith(FAILED):
            first.setdefault(verdict.method, []).append(verdict.reason.removeprefix(FAILED))
    return [f"method {m} failed on {len(why)} records ({why[0]})" for m, why in first.items()]


def choose_methods(names: Iterable[str]) -> list[str]:
    """Return method ids for names that may be sets of methods."""
    # each name once, sets as what they hold
    chosen: list[str] = []
    for name in split_names(names):
        # published thresholds, a set, or one method
        if name == PUBLISHED:
            some = registry.variants()
        elif name in _SETS:
            some = []
            for m in registry.names():
                if name != "fast" or registry.load(m).METHOD.budget == "fast":
                    some.append(m)
        else:
            registry.load(name)
            some = [name]
        chosen += [m for m in some if m not in chosen]
    return chosen


def score_units(
    verdicts: Iterable[tuple[str | None, Verdict]], labels: Mapping[str, Mapping[str, str]]
) -> list[dict[str, Any]]:
    """Score verdicts against labels by cost, in the columns of a run's scores, counted by unit: the
    records of a loop, or of loops that share an oscillation.
    """
    import pandas as pd

    # what each record says, by unit
    said = []
    for name, v in verdicts:
        row = labels.get(str(name))
        if row is not None and row["label"] not in ("", "unknown"):
            if v.verdict == NO_DECISION:
                vote = np.nan
            else:
                vote = float(v.verdict == STICTION)
            covers = v.applicable is not False
            said.append((v.method, row["unit_group"], row["label"], covers, vote, v.score))
    table = pd.DataFrame(said, columns=["method", "unit", "label", "covers", "vote", "score"])
    of_unit = table.groupby(["method", "unit", "label"], sort=False)
    units = of_unit.agg({"covers": "any", "vote": "mean", "score": "median"}).reset_index()

    # of each method the rates of the units that it covers: most of the votes decide
    rows = []
    for method, of in units.groupby("method", sort=False):
        some = of[of.covers]
        sticky = (some.label == STICTION).to_numpy()
        open_ = some.vote.isna().to_numpy()
        called = (some.vote > 0.5).to_numpy()
        right = ~open_ & (called == sticky)
        rows.append(
            {
                "method": method,
                "n": len(of),
                "applicable": len(some),
                "positives": int(sticky.sum()),
                **_cost_of(np.where(open_, _UNDECIDED, ~right)),
                "accuracy": _share_of(right),
                "sensitivity": _share_of(called[sticky]),
                "false_positives": _share_of(called[~sticky]),
                "no_decision": _share_of(open_),
                "auc": _area_under_curve(some.score.to_numpy(), sticky),
            }
        )
    return sorted(rows, key=lambda row: (np.isnan(row["cost"]), row["cost"]))


def _share_of(which: np.ndarray) -> float:
    if which.size:
        return float(which.mean())
    return float("nan")


def _cost_of(lost: np.ndarray) -> dict[str, float]:
    if not lost.size:
        return {"cost": float("nan"), "cost_lo": 0.0, "cost_hi": 1.0}
    # one unit of 0 and one of 1 added: few that all cost the same do not show the cost exactly
    mean = float(lost.mean())
    half = 1.96 * float(np.sqrt(np.var([*lost, 0.0, 1.0]) / lost.size))
    return {"cost": mean, "cost_lo": max(mean - half, 0.0), "cost_hi": min(mean + half, 1.0)}


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Return rows as lines of equal columns, the head first."""
    head = list(rows[0])
    return columns(
        [head]
        + [
            [_two_decimals(v) if isinstance(v, float) else str(v) for v in row.values()]
            for row in rows
        ]
    )


def _two_decimals(x: float) -> str:
    if np.isnan(x):
        return "-"
    return f"{x:.2f}"


def _area_under_curve(score: np.ndarray, sticky: np.ndarray) -> float:
    """Return the probability that a sticky unit scores above another (ties count half)."""
    known = ~np.isnan(score)
    pairs = score[sticky & known], score[~sticky & known]
    if not min(map(len, pairs)):
        return float("nan")
    # no subtraction: a loop that does not oscillate scores -inf
    return float(np.mean(np.greater.outer(*pairs) + 0.5 * np.equal.outer(*pairs)))
