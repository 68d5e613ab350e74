"""Judge the records of an exam by detectors; an interrupted call continues where it stopped."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import Any

from simbench.bench.execute.compute_piece import judge_record
from simbench.bench.execute.distribute import on_processes
from simbench.bench.execute.lease import lease
from simbench.bench.execute.run import choose_with_oracle
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.store.checksums import file_digest
from simbench.bench.store.manifest import code_hash
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import ParameterError
from simbench.detectors.plugins.host import SECONDS
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.record import LoopRecord
from simbench.files import folder as make_folder
from simbench.files import refuse_own_input, remove_stale_temporaries, whole_file
from simbench.progress import Progress
from simbench.sealed.exam.answers import NEEDED, OPTIONAL, rows_of
from simbench.sealed.exam.commitments import COMMITMENTS
from simbench.sealed.exam.folder import EXAM, LOOPS, RECORDS, read_exam

_PIECE = 8  # records: what is asked again after a kill


def answer_exam(
    folder: str | Path,
    out: str | Path,
    methods: Iterable[str] = ("fast",),
    plugins: Iterable[str | Path] = (),
    jobs: int = 1,
    resume: bool = False,
) -> int:
    """Write the answers of detectors to an exam, and return how many records were asked about now.

    Each detector sees what `run` shows it of the same loop, but for MV.
    """
    exam, out = read_exam(folder), Path(out)
    begun, parts = (out.with_name(f"{out.name}.{end}") for end in ("json", "partial"))
    own = [exam.file(name) for name in (EXAM, LOOPS, RECORDS, COMMITMENTS)]
    refuse_own_input([out, begun], own)
    files = [str(Path(p).resolve()) for p in plugins]
    with registry.hosted(files) as added:
        names = choose_with_oracle(methods, added)
        if ORACLE in names:
            raise ParameterError(
                f"exam: method {ORACLE!r} needs the truth, which an exam does not hold; name other"
                " methods"
            )
        asked = {
            "exam": exam.about["commitment"],
            "methods": names,
            "plugins": {Path(file).name: file_digest(Path(file)) for file in files},
            "code": code_hash(),
        }
        _refuse_other_question(out, begun, asked, resume)
        left = 0
        if not out.exists():
            with lease(make_folder(parts)):
                # once more: another call may have begun while this one waited
                _refuse_other_question(out, begun, asked, resume)
                if not begun.exists():
                    for piece in parts.glob("*.csv"):
                        piece.unlink()  # of another question
                    with whole_file(begun) as f:  # for whoever continues
                        f.write(json.dumps(asked, indent=1))
                left = _ask(exam.records, names, files, out, parts, jobs)
        rmtree(parts, ignore_errors=True)
        return left


def _refuse_other_question(
    out: Path, begun: Path, asked: Mapping[str, object], resume: bool
) -> None:
    """Raise ParameterError where answers are there that nobody wants continued, or that were asked
    of other methods, plug-ins or code, or about another exam.
    """
    if not (out.exists() or begun.exists()):
        return
    if not resume:
        raise ParameterError(
            f"exam: {out} was begun already; continue it with --resume, or choose another file"
        )
    try:
        before = json.loads(begun.read_text(encoding="utf-8"))
        differ = [name for name in asked if before[name] != asked[name]]
    except (OSError, ValueError, KeyError, TypeError):
        differ = ["settings"]
    if differ:
        raise ParameterError(
            f"exam: the answers {out} were begun with other {differ[0]}, as {begun.name} says;"
            " remove both, or choose another file"
        )


def _ask(
    records: Mapping[str, LoopRecord],
    names: Sequence[str],
    plugins: Sequence[str],
    out: Path,
    parts: Path,
    jobs: int,
) -> int:
    """Ask for the pieces that do not lie in `parts` yet, and join all of them."""
    remove_stale_temporaries(parts)
    ids = list(records)
    pieces = {
        parts / f"{i:06d}.csv": {name: records[name] for name in ids[i : i + _PIECE]}
        for i in range(0, len(ids), _PIECE)
    }
    todo = [(file, some) for file, some in pieces.items() if not file.exists()]
    left, failed = sum(len(some) for _, some in todo), Counter()
    bar = Progress(total=len(ids), initial=len(ids) - left, desc="answered", delay=1.0)
    with on_processes(jobs) as run, bar:
        answered: Any = run(partial(_answers, names, plugins), todo)  # pyright: ignore[reportArgumentType]
        for file, text, errors in answered:
            with whole_file(file) as f:
                f.write(text)
            failed.update(errors)
            bar.update(len(pieces[file]))
    with whole_file(out) as f:
        f.write(",".join((*NEEDED, *OPTIONAL)) + "\n")
        f.writelines(file.read_text(encoding="utf-8") for file in pieces)
    for method, count in failed.items():
        print(
            f"method {method} failed on {count} of {left} records, which are answered no_decision",
            file=sys.stderr,
        )
    return left


def _answers(
    names: Sequence[str], plugins: Sequence[str], file: Path, records: Mapping[str, LoopRecord]
) -> tuple[Path, str, dict[str, int]]:
    """Return the file of a piece, the lines of its answers, and on how many of its records each
    method failed.
    """
    registry.add_hosted(*plugins, seconds=SECONDS)
    chosen = {name: registry.load(name).METHOD.defaults() for name in names}
    lines, failed = [], Counter()
    with one_thread():
        for ident, record in records.items():
            answers = judge_record(record, chosen)[1]
            lines.append(rows_of(ident, (answer.verdict for answer in answers)))
            failed.update(said.method for said, error, _ in answers if error is not None)
    return file, "".join(lines), dict(failed)
