"""`python -m results.studies.withheld make|answer|open|score DIR`: judge the gap diagnosis, and
those of other people, by simulated records whose true cause is hidden from them.

`make` draws them with a plant simulator of its own and writes the truth to a key, `answer`
diagnoses them, `open` scores the answers, `score` sets diagnoses of other people beside them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from results.studies.withheld.answering import answer
from results.studies.withheld.making import make
from results.studies.withheld.opening import open_
from results.studies.withheld.others import score
from results.studies.withheld.page import write_page
from results.studies.worlds import NAMES
from simbench.usage import exit_code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.withheld",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    made = verbs.add_parser("make", help="draw records")
    made.add_argument("--key", required=True, help="write the truth to this file, outside DIR")
    made.add_argument("--seed", type=int, required=True)
    made.add_argument("-n", type=int, default=600, help="about this many records [600]")
    answered = verbs.add_parser("answer", help="diagnose the records; resumes where it stopped")
    opened = verbs.add_parser("open", help="score the answers")
    opened.add_argument("--scores", metavar="DIR", help="write the scores to this folder")
    scored = verbs.add_parser("score", help="score diagnoses that others made")
    for verb in (made, answered, opened, scored):
        verb.add_argument("folder", metavar="DIR")
    scored.add_argument(
        "file", metavar="FILE.csv", nargs="*", type=Path, help="columns id, effect, probability"
    )
    scored.add_argument("--page", metavar="FILE.html", help="also write a page")
    for verb in (opened, scored):
        verb.add_argument("--key", help="read the truth from this file")
    for verb in (made, opened):
        verb.add_argument("--world", default=NAMES[0], help=f"the plant simulator [{NAMES[0]}]")
    for verb in (made, answered):
        verb.add_argument("-j", type=int, default=1, help="processes, -1 for all cores [1]")
    return parser


def run(argv: Sequence[str] | None = None) -> int:
    """Make, answer or open a blind test."""
    o = _parser().parse_args(argv)
    if o.verb == "make":
        print(make(o.folder, o.key, o.seed, o.n, jobs=o.j, world=o.world))
    elif o.verb == "answer":
        print(f"{answer(o.folder, o.j)} records diagnosed")
    elif o.verb == "score":
        scores = score(o.folder, o.file, o.key)
        print(scores.as_text())
        if o.page:
            write_page(scores, o.page)
    else:
        print(open_(o.folder, o.key, o.scores, o.world)["markdown"])
    return 0


if __name__ == "__main__":
    sys.exit(exit_code(run))
