"""The verb `trust`: which method to trust on one loop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from simbench.cli.common import (
    Jobs,
    Json,
    MethodIds,
    Page,
    app,
    examples,
    reads,
    say_assumed,
    show_result,
)


@app.command(
    "trust",
    epilog=examples("trust rec.csv -j 4", "trust rec.csv --loop loop.toml --html trust.html"),
)
@reads
def trust_(
    path: Annotated[Path, Argument(metavar="REC.csv", help="Read this record.")],
    loop: Annotated[
        Path | None,
        Option(
            metavar="LOOP.toml",
            help="Simulate this loop file (as `simbench simulate` reads it) instead of a loop"
            " identified from the record. In `simbench detect`, --loop chooses a tag instead.",
        ),
    ] = None,
    method: MethodIds = None,
    jobs: Jobs = 1,
    html: Page = None,
    as_json: Json = False,
    *,
    about: dict,
) -> None:
    """Report which detector to trust on a loop, and which stiction its record could show.

    The loop is simulated again about 200 times, with a healthy valve and with stiction of ten
    sizes. Every detector judges these simulated replicates, for which the right answer is known.

    The table has one row per method: those that agree with the conclusion first, then by accuracy.
    With the published threshold: its verdict on the record, its false-positive rate on healthy
    replicates, and the smallest stick band S from which it detects four of five sticky replicates,
    for a slip-jump J of S/4 and of S.
    As advised for this loop: the score above which the method should report stiction (empty: as
    published), and its accuracy on the replicates with that threshold.
    """
    from simbench.trust.command import trust_file

    trust = trust_file(path, loop, method or ["all"], html=html, jobs=jobs, **about)
    show_result(trust, as_json)
    say_assumed([trust.record], as_json)
