"""Judge records from the command line: `python -m simbench.detectors REC.csv --method all
--kind flow --json`.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from simbench.detectors.detection import judge_files
from simbench.detectors.record import KINDS, PROCESSES
from simbench.detectors.records.roles import column_pairs
from simbench.detectors.report.report import failed, table
from simbench.detectors.usage import exit_code


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 2 wrong usage or file."""
    parser = argparse.ArgumentParser(
        prog="python -m simbench.detectors",
        description="Show the verdict of each stiction detector on the records of control loops."
        " `simbench detect` adds a conclusion with its probability.",
    )
    add = parser.add_argument
    add("path", help="Read this record (CSV, parquet, Excel), folder of records, or ISDB .mat.")
    add(
        "--method",
        action="append",
        help="Apply these methods: ids, or the groups all, fast or full; may be repeated [all].",
    )
    add("--process", choices=PROCESSES, help="State the type of the process.")
    add("--kind", help=f"State what the loop controls: {', '.join(KINDS)}.")
    for signal in ("op", "pv"):
        add(
            f"--{signal}-span",
            nargs=2,
            type=float,
            metavar=("LO", "HI"),
            help=f"State the recorded values of {signal.upper()} that mean 0 and 100 %%.",
        )
    add(
        "--columns",
        action="append",
        metavar="op=NAME,pv=NAME",
        help="Assign a column to a signal; may be repeated.",
    )
    add(
        "--ts",
        type=float,
        dest="Ts",
        metavar="S",
        help="State the sampling period (s) of a record without a time column.",
    )
    add(
        "--longest-segment",
        action="store_true",
        help="Judge the longest part without a gap, if the record has long gaps.",
    )
    add(
        "--tag",
        "--loop",
        metavar="TAG",
        help="Choose one loop by its tag from a file with several: FIC101, chemicals.loop1.",
    )
    add(
        "--loops",
        metavar="TABLE.toml",
        help="Read what is known of each loop from this file, with one [[loop]] table per tag.",
    )
    add("--why", action="store_true", help="Print each method's reason below the table.")
    add("--labels", help="Score the records that this table lists (columns id and label).")
    add("--plugin", action="append", default=[], help="Load an additional detector from this file.")
    add("--json", action="store_true", help="Print JSON, and nothing else, on stdout.")
    chosen = vars(parser.parse_args(arguments))
    as_json, methods, why = chosen.pop("json"), chosen.pop("method") or ["all"], chosen.pop("why")
    command = ["python", "-m", "detectors", *(sys.argv[1:] if arguments is None else arguments)]
    return exit_code(lambda: _judge(as_json, why, methods=methods, **chosen), command=command)


def _judge(as_json: bool, why: bool, **asked: Any) -> int:
    asked["columns"] = column_pairs(asked["columns"])
    report = judge_files(
        asked.pop("path"), asked.pop("methods"), plugins=asked.pop("plugin"), **asked
    )
    for name, sentence in report.refused.items():
        print(f"left out {name}: {sentence}", file=sys.stderr)
    for sentence in failed(report.verdicts):
        print(sentence, file=sys.stderr)
    if as_json:
        print(json.dumps(report.as_json(), indent=1, allow_nan=False))
        if report.scores:
            print("\n".join(["score by unit:", *table(report.scores)]), file=sys.stderr)
    else:
        print(report.as_text(why=why, colour=sys.stdout.isatty()))
    sys.stdout.flush()
    return 1 if report.refused else 0


if __name__ == "__main__":
    sys.exit(main())
