"""The verbs of `simbench exam`: make an exam, answer it, open it with the key."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from simbench.cli.common import (
    Full,
    GridName,
    Jobs,
    Json,
    Plugin,
    Report,
    Resume,
    exam_app,
    examples,
    say,
    show,
)

Folder = Annotated[Path, Argument(metavar="EXAM", help="Read the exam in this folder.")]
NewKey = Annotated[
    Path,
    Option(
        "--key",
        metavar="FILE",
        help="Write the key (grid and seed) to this new file outside the exam's folder.",
    ),
]
Key = Annotated[Path, Option(metavar="FILE", help="Read the key that `exam make` wrote.")]


@exam_app.command(
    epilog=examples(
        "exam make ci -o exam --key exam.key", "exam make ci -o exam --key exam.key --n 200 -j 2"
    )
)
def make(
    grid: GridName,
    out: Annotated[
        Path,
        Option(
            "-o",
            "--out",
            metavar="EXAM",
            help="Write the exam to this folder, which must not exist.",
        ),
    ],
    key: NewKey,
    n: Annotated[
        int | None,
        Option("--n", metavar="N", help="Draw this many records at random from the grid [all]."),
    ] = None,
    jobs: Jobs = 1,
    seed: Annotated[int | None, Option(min=0, hidden=True)] = None,
) -> None:
    """Simulate new records and write them without labels; the key goes elsewhere.

    The command prints a commitment: a checksum of the key. Publish it before the answers come
    in; it proves later that neither records nor labels were changed.
    """
    from simbench.sealed.exam.making import make_exam

    print(f"commitment {make_exam(grid, out, key, n, jobs, seed)}")
    say(f"Publish this checksum of the key now, hand out the folder {out}, and keep {key} secret.")


@exam_app.command(
    epilog=examples(
        "exam answer exam -o answers.csv -j 2",
        "exam answer exam -o mine.csv --plugin mine.py --method mine",
    )
)
def answer(
    folder: Folder,
    out: Annotated[
        Path,
        Option("-o", "--out", metavar="ANSWERS.csv", help="Write the answers to this file (CSV)."),
    ],
    method: Annotated[
        list[str] | None,
        Option(
            metavar="ID",
            help="Apply these methods: ids, or the groups fast or full; may be repeated [fast].",
        ),
    ] = None,
    plugin: Plugin = None,
    jobs: Jobs = 1,
    resume: Resume = False,
) -> None:
    """Judge every record of an exam by detectors or plug-ins, and write the answers."""
    from simbench.sealed.exam.answering import answer_exam

    say(
        f"{answer_exam(folder, out, method or ['fast'], plugin or [], jobs, resume)} records"
        f" answered: {out}"
    )


@exam_app.command(epilog=examples("exam commit answers.csv --exam exam"))
def commit(
    answers: Annotated[Path, Argument(metavar="ANSWERS.csv", help="Read this file of answers.")],
    folder: Annotated[
        Path,
        Option(
            "--exam", metavar="EXAM", help="Add the checksum to the list in this exam's folder."
        ),
    ],
) -> None:
    """List the checksum of answers in the exam, before it is opened.

    `exam open` marks answers that were not listed before the first opening: whoever wrote them
    may have known the labels.
    """
    from simbench.sealed.exam.commitments import COMMITMENTS, commit_answers

    print(f"sha256 {commit_answers(answers, folder)}")
    say(f"{answers} is listed in {folder / COMMITMENTS}; change it no more.")


@exam_app.command(
    "open",
    epilog=examples("exam open exam --key exam.key answers.csv mine.csv --report report.html"),
)
def open_(
    folder: Folder,
    answers: Annotated[
        list[Path], Argument(metavar="ANSWERS.csv...", help="Score these files of answers.")
    ],
    key: Key,
    labels: Annotated[
        Path | None,
        Option(metavar="FILE.csv", help="Write the labels of every record to this file (CSV)."),
    ] = None,
    report: Report = None,
    jobs: Jobs = 1,
    full: Full = False,
    as_json: Json = False,
) -> None:
    """Check the key, simulate every record again, then score the answers.

    The table is that of `simbench score`; its help explains the columns.
    """
    from simbench.bench.execute.failures import read_failures
    from simbench.bench.score.scoring import score_run
    from simbench.files import refuse_own_input, write_table
    from simbench.sealed.exam.commitments import COMMITMENTS, OPENINGS
    from simbench.sealed.exam.folder import EXAM, LOOPS, RECORDS
    from simbench.sealed.exam.opening import opened_exam

    refuse_own_input(
        [labels, report],
        [
            *(folder / name for name in (EXAM, LOOPS, RECORDS, COMMITMENTS)),
            *(key, key.with_name(OPENINGS), *answers),
        ],
    )
    with opened_exam(folder, key, answers, jobs) as opened:
        scores, missing = score_run(opened.run), opened.missing
        content = {
            **scores.as_json(),
            "failed": read_failures(opened.run).as_json(),
            "missing": missing,
        }
        lines = [
            f"{name} left out {count} records, which count as no decision"
            for name, count in missing.items()
        ]
        lines += [
            f"{name} answered after opening: its answers were not listed by `exam commit` before"
            for name in opened.late
        ]
        if labels is not None:
            write_table(opened.labels, labels)
        if report is not None:
            from simbench.report import write_report

            write_report(opened.run, report)
        show(
            (
                content
                if as_json
                else "\n".join([*lines, *[""][: len(lines)], scores.as_text(full=full)])
            ),
            as_json,
        )
        if report is not None:
            say(f"report: {report.resolve()}", as_json)
