"""Diagnose every record of a folder by itself (`simbench gap diagnose FOLDER`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed

from simbench.detectors.errors import Refusal, UserError
from simbench.detectors.faults import sentence_of
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_folder
from simbench.detectors.report.report import columns
from simbench.gap.closed_loop.gap import within_reach
from simbench.gap.closed_loop.remaining import Remaining
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.partial import Partial, read_baseline
from simbench.gap.report.ranked import words
from simbench.gap.stiction.conclusion import WORDS
from simbench.gap.thresholds import NEAR
from simbench.parallel import run_parallel
from simbench.scenarios.spec import Loop

_HEAD = (
    "record",
    "effect",
    "block",
    "probability",
    "gap",
    "after",
    "floor",
    "plant",
    "near",
    "valve",
)
_FLOORS = {"floor": "the simulation", "plant_floor": "the plant"}


@dataclass(frozen=True)
class FolderDiagnosis:
    """What `gap diagnose` answers of each record of a folder.

    Parameters
    ----------
    answers : dict of str to dict
        The JSON of a diagnosis by record.
    refused : dict of str to str
        Why a file is no record, or a record was not diagnosed, in a sentence each.
    """

    answers: dict[str, dict[str, Any]]
    refused: dict[str, str]

    def write_page(self, path: str | Path) -> None:
        """Write the answers as one self-contained HTML page.

        Parameters
        ----------
        path : str or Path
            HTML file to write.
        """
        from simbench.gap.report.folder_page import write_folder_page

        said = [self._count_effects(), *self._nearness(), *self._remains()]
        write_folder_page(self.answers, said, self.refused, path)

    def _count_effects(self) -> str:
        named = ", ".join(f"{words(effect)} {n}" for effect, n in self.counts().items())
        return f"Records in which each effect was named: {named or 'none was diagnosed'}."

    def counts(self) -> dict[str, int]:
        """Return how many records each effect was named in, the most frequent first.

        Returns
        -------
        dict
            Number of records by effect id, "none" and "unknown" among them.
        """
        return dict(Counter(a["effect"] for a in self.answers.values()).most_common())

    def as_json(self) -> list[dict[str, Any]]:
        """Return the diagnosis of every record, with its name; of one without, the reason.

        Returns
        -------
        list of dict
            One object per record: `record`, and the keys of a diagnosis; `effect` is None, and
            `reason` says why, where there is none.
        """
        answers = [{"record": name, **answer} for name, answer in self.answers.items()]
        return [
            *answers,
            *({"record": n, "effect": None, "reason": why} for n, why in self.refused.items()),
        ]

    def as_text(self) -> str:
        """Return how often each effect was named, and a table of one row per record.

        Returns
        -------
        str
            Lines for a terminal.
        """
        rows = []
        for name, a in self.answers.items():
            gap = a["gap"]
            valve = a["conclusion"]["verdict"]
            sizes = (f"{gap[key]:.2f}" for key in ("before", "after", "floor", "plant_floor"))
            p = f"{a['effects'][0]['probability']:.2f}"
            near = "yes" if gap["near"] else "no"
            rows.append((name, words(a["effect"]), a["block"], p, *sizes, near, WORDS[valve]))
        return "\n".join(
            [
                self._count_effects(),
                *self._nearness(),
                *(["", *columns([_HEAD, *rows])] if rows else []),
                *self._remains(),
                *(f"{name}: {why}" for name, why in self.refused.items()),
            ]
        )

    def _nearness(self) -> list[str]:
        """Return how many simulations come near their record, before and after the answer."""
        gaps = [a["gap"] for a in self.answers.values()]
        if not gaps:
            return []
        lines = []
        for floor, of in _FLOORS.items():
            before, after = (
                f"{np.mean([within_reach(gap[size], gap[floor]) for gap in gaps]):.2f}"
                for size in ("before", "after")
            )
            lines.append(
                f"Within {NEAR} floors of {of}: {before} of the records before, {after} after."
            )
        return lines

    def _remains(self) -> list[str]:
        """Return what remains plainest in each record that the simulations do not come near."""
        lines = [
            f"{name}: {Remaining.from_json(a['remaining'][0]).sentence()}"
            for name, a in self.answers.items()
            if a["remaining"] and not a["gap"]["near"]
        ]
        head = ["", "The plainest difference that remains where the gap does:"]
        return [*head, *lines] if lines else []


def diagnose_folder(
    folder: str | Path | Sequence[str | Path],
    baseline: str | Path | None = None,
    jobs: int = 1,
    *,
    identify: bool = False,
    **about: Any,
) -> FolderDiagnosis:
    """Diagnose every record of one folder or several by itself.

    Parameters
    ----------
    folder : str, Path, or sequence of them
        Folders of records; of records of one name the one in the last folder is diagnosed.
    baseline : str or Path, optional
        Loop file of all records. Without it a record's baseline is the loop file of its name beside
        it; where there is none, the loop is identified from the record.
    jobs : int
        Processes; -1 uses all cores.
    identify : bool
        Identify every loop, whatever lies beside its record.
    **about
        What is known of the records, as in `read_record`.

    Returns
    -------
    FolderDiagnosis
        One answer per record; what could not be diagnosed, with its reason.

    Raises
    ------
    UserError
        For a folder without records, or a loop file that cannot be read.

    Notes
    -----
    Not for several records of one loop: `diagnose_files` judges these together.

    Examples
    --------
    >>> import tempfile
    >>> from simbench.files import write_record
    >>> from random_case import random_case
    >>> case, place = random_case(3, ("detuning",)), Path(tempfile.mkdtemp())
    >>> write_record(case.record, place / "FIC101.csv")
    >>> _ = (place / "FIC101.toml").write_text(case.baseline.to_toml())
    >>> diagnose_folder(place).counts()
    {'detuning': 1}
    """
    records: dict[str, LoopRecord] = {}
    refused: dict[str, str] = {}
    places: dict[str, Path] = {}
    for place in [folder] if isinstance(folder, (str, Path)) else folder:
        found, failed = read_folder(place, **about)
        records |= found
        refused |= failed
        places |= dict.fromkeys(found, Path(place))
    shared = None if baseline is None else read_baseline(baseline)
    asked = {
        name: shared or (None if identify else _baseline_beside(places[name], name))
        for name in records
    }
    calls = [delayed(_diagnose_one)(records[name], loop) for name, loop in asked.items()]
    answers = dict(zip(asked, run_parallel(calls, jobs, "diagnosed"), strict=True))
    failed = {name: one.reason for name, one in answers.items() if isinstance(one, Refusal)}
    return FolderDiagnosis(
        {name: one for name, one in answers.items() if not isinstance(one, Refusal)},
        {**refused, **failed},
    )


def _baseline_beside(folder: Path, name: str) -> Loop | Partial | None:
    file = folder / f"{name}.toml"
    return read_baseline(file) if file.is_file() else None


def _diagnose_one(record: LoopRecord, loop: Loop | Partial | None) -> dict[str, Any] | Refusal:
    """Return the JSON of a diagnosis, or why there is none: the other records are answered."""
    try:
        return diagnose(record, loop).as_json()
    except UserError as error:
        return Refusal(str(error))
    except Exception as fault:
        return Refusal(sentence_of(fault))
