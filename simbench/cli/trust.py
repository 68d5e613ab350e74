"""The verb `trust`: which method to trust on loops like one record's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument

from simbench.cli.common import (
    Jobs,
    Json,
    MethodIds,
    app,
    examples,
    reads,
    say_assumed,
    show_result,
)


@app.command("trust", epilog=examples("trust rec.csv -j 4", "trust rec.csv --method fast --json"))
@reads
def trust_(
    path: Annotated[Path, Argument(metavar="REC.csv", help="Read this record.")],
    method: MethodIds = None,
    jobs: Jobs = 1,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Report which method to trust on loops like this one, and which stiction it finds there.

    The loop that copies the record is simulated again under fresh loads, with a sound valve and
    with stiction of twelve sizes, and every method judges these simulations, whose truth is known.
    It is a small `simbench run REC.csv`, which writes every table and takes more methods.

    The table has one row per method, the most reliable first: its verdict on the record, its
    accuracy and its false-positive rate on the simulated loops, and the smallest stick band S from
    which on it finds four of five sticking valves (-: none of the sizes tried).
    """
    from simbench.detectors.records.io import read_record
    from simbench.trust.trust import trust

    trusted = trust(read_record(path, **about), method or ["all"], jobs=jobs)
    show_result(trusted, as_json)
    say_assumed([trusted.record], as_json)
