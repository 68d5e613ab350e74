"""Judge records from the command line: `python -m detectors REC.csv --method all --kind flow
--json`.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from detectors.detection import judge_files
from detectors.prepared import FRONT_ENDS
from detectors.record import KINDS, PROCESSES
from detectors.records.roles import column_pairs
from detectors.report.report import failed, table
from detectors.usage import exit_code


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 2 wrong usage or file."""
    parser = argparse.ArgumentParser(
        prog="python -m detectors", description="Does this control valve stick?"
    )
    parser.add_argument(
        "path", help="record (CSV, parquet, Excel), folder of records, or ISDB .mat"
    )
    parser.add_argument(
        "--method", action="append", help="method id, or all, fast, full; repeatable (default: all)"
    )
    parser.add_argument("--process", choices=PROCESSES)
    parser.add_argument("--kind", help=f"what the loop controls: {', '.join(KINDS)}")
    parser.add_argument(
        "--op-span", nargs=2, type=float, metavar=("LO", "HI"), help="OP that means 0 and 100 %%"
    )
    parser.add_argument("--pv-span", nargs=2, type=float, metavar=("LO", "HI"))
    parser.add_argument(
        "--columns", action="append", metavar="op=NAME,pv=NAME", help="which column is what"
    )
    parser.add_argument(
        "--ts",
        type=float,
        dest="Ts",
        metavar="S",
        help="sampling period (s), where no column says it",
    )
    parser.add_argument(
        "--longest-segment",
        action="store_true",
        help="of a record with long gaps, take the longest part",
    )
    parser.add_argument(
        "--tag",
        "--loop",
        metavar="TAG",
        help="loop of a file with several: FIC101, chemicals.loop1",
    )
    parser.add_argument(
        "--loops", metavar="TABLE.toml", help="what is known of loops, a [[loop]] table per tag"
    )
    parser.add_argument("--why", action="store_true", help="each method's reason below the table")
    parser.add_argument("--labels", help="table with id and label: judge and score its records")
    parser.add_argument("--raw", action="store_true", help="without the oscillation front end")
    parser.add_argument(
        "--front-end",
        default="acf",
        help=f"what says whether a loop oscillates: {' or '.join(FRONT_ENDS)}",
    )
    parser.add_argument("--plugin", action="append", default=[], help="file of a further detector")
    parser.add_argument("--json", action="store_true", help="JSON, and nothing else, on stdout")
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
    return 0


if __name__ == "__main__":
    sys.exit(main())
