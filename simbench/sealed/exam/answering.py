"""Judge the records of an exam by detectors; an interrupted call continues where it stopped."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from shutil import rmtree

from simbench.bench.execute.compute_piece import judge_record
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
from simbench.sealed.exam.answers import NEEDED, OPTIONAL, read_answers, rows_of
from simbench.sealed.exam.commitments import COMMITMENTS
from simbench.sealed.exam.folder import EXAM, LOOPS, RECORDS, read_exam
from simbench.sealed.handout import ask_in_processes

_PIECE = 8  # records: what is asked again after a kill
_SETTINGS = "settings.json"


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
    refuse_own_input([out], [exam.file(name) for name in (EXAM, LOOPS, RECORDS, COMMITMENTS)])
    files = [str(Path(p).resolve()) for p in plugins]
    with registry.hosted(files) as added:
        names = choose_with_oracle(methods, added)
        if ORACLE in names:
            raise ParameterError(
                f"exam: method {ORACLE!r} needs the truth, which an exam does not hold; name other"
                " methods"
            )
        settings = {
            "commitment": exam.about["commitment"],
            "methods": names,
            "plugins": {Path(file).name: file_digest(Path(file)) for file in files},
            "code": code_hash(),
        }
        parts = out.with_name(f"{out.name}.partial")
        if not resume and (out.exists() or parts.exists()):
            there = out if out.exists() else parts
            raise ParameterError(
                f"exam: {there} exists already; continue it with --resume, or choose another file"
            )
        asked = out.with_name(f"{out.name}.{_SETTINGS}")
        if out.exists():
            _refuse_other_answers(out, names, exam.records)
            if files:
                _refuse_other_settings(asked, settings)
            rmtree(parts, ignore_errors=True)  # of a call that was killed as it ended
            return 0
        with lease(make_folder(parts)):
            if not (parts / _SETTINGS).exists():
                with whole_file(parts / _SETTINGS) as f:
                    f.write(json.dumps(settings, indent=1))
            _refuse_other_settings(parts / _SETTINGS, settings)
            left = _ask(exam.records, names, files, out, parts, jobs)
        rmtree(parts, ignore_errors=True)
        if files:  # a later --resume shows by it whether a plug-in was changed
            with whole_file(asked) as f:
                f.write(json.dumps(settings, indent=1))
        return left


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
        f"{i:06d}.csv": {name: records[name] for name in ids[i : i + _PIECE]}
        for i in range(0, len(ids), _PIECE)
    }
    todo = {
        name: (some, names, plugins) for name, some in pieces.items() if not (parts / name).exists()
    }
    left, failed = sum(len(some) for some, *_ in todo.values()), Counter()
    with Progress(total=len(ids), initial=len(ids) - left, desc="answered", delay=1.0) as bar:
        for name, (text, errors) in ask_in_processes(_answers, todo, jobs):
            with whole_file(parts / name) as f:
                f.write(text)
            failed.update(errors)
            bar.update(len(pieces[name]))
    with whole_file(out) as f:
        f.write(",".join((*NEEDED, *OPTIONAL)) + "\n")
        f.writelines((parts / name).read_text(encoding="utf-8") for name in pieces)
    for method, count in failed.items():
        print(
            f"method {method} failed on {count} of {left} records, which are answered no_decision",
            file=sys.stderr,
        )
    return left


def _refuse_other_answers(
    out: Path, names: Sequence[str], records: Mapping[str, LoopRecord]
) -> None:
    """Raise ParameterError unless a file holds every answer of these methods and no other."""
    there = read_answers([out], records)
    if set(there) != set(names) or any(len(of) < len(records) for of in there.values()):
        raise ParameterError(
            f"exam: {out} holds other answers than those of {', '.join(names)}; choose another file"
        )


def _refuse_other_settings(file: Path, settings: Mapping[str, object]) -> None:
    """Raise ParameterError when what was asked was asked of other methods or plug-ins, or about
    another exam.
    """
    try:
        before = json.loads(file.read_text(encoding="utf-8"))
        differ = [name for name in settings if before[name] != settings[name]]
    except (OSError, ValueError, KeyError, TypeError):
        differ = [_SETTINGS]
    if differ:
        raise ParameterError(
            f"exam: the answers that {file} describes were begun with other {differ[0]}; remove"
            " them, or choose another file"
        )


def _answers(
    records: Mapping[str, LoopRecord], names: Sequence[str], plugins: Sequence[str]
) -> tuple[str, dict[str, int]]:
    """Return the lines of some records' answers, and on how many each method failed."""
    registry.add_hosted(*plugins, seconds=SECONDS)
    chosen = {name: registry.load(name).METHOD.defaults() for name in names}
    lines, failed = [], Counter()
    with one_thread():
        for ident, record in records.items():
            answers = judge_record(record, chosen)[1]
            lines.append(rows_of(ident, (answer.verdict for answer in answers)))
            failed.update(said.method for said, error, _ in answers if error is not None)
    return "".join(lines), dict(failed)
