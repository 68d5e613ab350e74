"""Ask every verb that concludes for its conclusion on labelled records.

`python benchmarks/verbs_on_records.py FOLDER LABELS` runs `detect`, `diagnose` and `gap
diagnose`, and `detect` on the folder, as a user would, with nothing but what the table of labels
states of each loop. It prints one row per loop with the probability of stiction and the conclusion
of each verb, then for each verb how many loops, and how many units, agree with their labels. A unit
is a loop, or several that share an oscillation. All verbs should conclude the same.
"""

from __future__ import annotations

import contextlib
import csv
import io
import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from simbench.cli import main as simbench
from simbench.detectors.records.folder import read_labels
from simbench.detectors.verdict import PROBABILITY
from simbench.detectors.views import columns
from simbench.gap.stiction.conclusion import WORDS, count_agreement, group_conclusions

_VERBS = {
    "detect": "detect FILE --method likelihood",
    "diagnose": "diagnose FILE",
    "gap diagnose": "gap diagnose FILE --identify",
}
_FOLDER = "detect FOLDER"
_ANSWER = re.compile(r"\(probability of stiction ([\d.]+|unknown)\)")


@dataclass(frozen=True)
class Concluded:
    """What a verb printed of one record; None where it printed that nothing is known."""

    probability: float | None


def ask(words: list[str]) -> str:
    """Run a verb and return what it printed."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
        simbench(words)
    return printed.getvalue()


def ask_on_record(verb: str, file: Path, row: dict[str, str]) -> Concluded:
    """Return the conclusion of a verb on one record."""
    words = [str(file) if word == "FILE" else word for word in _VERBS[verb].split()]
    for option in ("kind", "process"):
        words += [f"--{option}", row[option]] if row[option] else []
    answer = _ANSWER.search(ask(words))
    known = answer is not None and answer[1] != "unknown"
    return Concluded(float(answer[1]) if known else None)


def ask_on_folder(folder: Path, labels: Path) -> dict[str, Concluded]:
    """Return what `detect` on the folder writes of each record to its table."""
    with tempfile.TemporaryDirectory() as place:
        table = Path(place) / "table.csv"
        words = ["--labels", str(labels), "--method", "likelihood", "--csv", str(table)]
        ask(["detect", str(folder), *words])
        with open(table, newline="", encoding="utf-8") as f:
            cells = {row["record"]: row[PROBABILITY] for row in csv.DictReader(f)}
    return {name: Concluded(float(p) if p else None) for name, p in cells.items()}


def main(folder: Path, labels: Path) -> None:
    """Print the table of loops, and for each verb how often it agrees with the labels."""
    known = read_labels(labels)
    files = {f.stem: f for f in sorted(folder.glob("*.csv")) if f.stem in known}
    by_verb = {
        verb: {name: ask_on_record(verb, f, known[name]) for name, f in files.items()}
        for verb in _VERBS
    }
    by_verb[_FOLDER] = ask_on_folder(folder, labels)
    loops = {verb: group_conclusions(c, known, "loop") for verb, c in by_verb.items()}
    rows = [("loop", "label", "records", *by_verb)]
    for (name, label), (n, _, _) in loops[_FOLDER].items():
        answers = (loops[verb].get((name, label), (0, None, "no_decision")) for verb in by_verb)
        cells = [f"{'' if p is None else f'{p:.2f} '}{WORDS[answer]}" for _, p, answer in answers]
        rows.append((name, label, str(n), *cells))
    print("\n".join([*columns(rows), ""]))
    sentences: dict[str, list[str]] = {}
    for verb in by_verb:
        units = group_conclusions(by_verb[verb], known, "unit_group")
        for what, groups in (("loop", loops[verb]), ("unit", units)):
            sentences.setdefault(count_agreement(what, groups), []).append(verb)
    print("\n".join(f"{', '.join(verbs)}: {one}" for one, verbs in sorted(sentences.items())))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
