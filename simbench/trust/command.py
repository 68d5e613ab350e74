"""The verbs of this subpackage on files: read records, write answers and pages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from simbench.detectors.records.io import read_folder, read_record
from simbench.files import refuse_own_input
from simbench.scenarios.spec import load_loop
from simbench.trust.result import Trust
from simbench.trust.trust import trust


def trust_file(
    path: str | Path,
    loop: str | Path | None = None,
    methods: Sequence[str] = ("all",),
    *,
    html: str | Path | None = None,
    jobs: int = 1,
    **about: Any,
) -> Trust:
    """Say of a record file which detector to believe, what could have been seen, and how probable
    stiction is.
    """
    refuse_own_input([html], [path, loop])
    record, known = read_record(path, **about), None if loop is None else load_loop(loop)
    trusted = trust(record, known, methods, jobs=jobs)
    if html is not None:
        from simbench.trust.page import write_page

        write_page(trusted, html)
    return trusted


def power_lines(path: str | Path, methods: Sequence[str] = ("all",), **about: Any) -> list[str]:
    """Return one line per record on what it could have shown; `path` is a record or a folder of
    them.
    """
    if Path(path).is_dir():
        records, _ = read_folder(path, **about)
        return [
            f"{name}: {trust(r, methods=methods, help_wanted=False).power_line()}"
            for name, r in records.items()
        ]
    return [trust(read_record(path, **about), methods=methods, help_wanted=False).power_line()]
