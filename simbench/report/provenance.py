"""Section of the report: the commands, versions and seeds behind the results, and how to reproduce
them.
"""

import shlex
from typing import Any

import pandas as pd
from markupsafe import Markup

from simbench.html.table import sortable
from simbench.report.data import RunData
from simbench.report.page import render

TITLE = "Provenance"
_SHOWN = {
    "grid": "grid",
    "grid_hash": "hash of the grid",
    "records_hash": "hash of the simulated records",
    "seed": "seed of the grid",
    "scenarios": "scenarios planned",
    "commit": "commit",
    "code": "hash of the code",
    "machine": "machine",
    "command": "command",
}


def section(run: RunData) -> Markup:
    """Return the manifest of the run and the commands that repeat it."""
    manifest = run.book.manifest
    rows = [(title, manifest.get(key)) for key, title in _SHOWN.items()]
    rows += [(f"version of {name}", value) for name, value in manifest.get("versions", {}).items()]
    frame = pd.DataFrame(
        [(name, "" if value is None else str(value)) for name, value in rows],
        columns=["what", "value"],
    )
    return render(
        "provenance.html",
        table=sortable(frame, long=["value"]),
        commands=reproduce(manifest),
        folder=run.folder,
        exam=manifest.get("exam"),
    )


def reproduce(manifest: dict[str, Any]) -> list[str]:
    """Return the commands that give the same tables from a checkout of the same commit."""
    if manifest.get("exam"):
        return ["simbench exam open EXAM --key KEY ANSWERS.csv --report REPORT.html"]
    words = ["simbench", "run", str(manifest["grid"]), "-o", "again"]
    words += ["--set", f"seed={manifest['seed']}"]
    words += [
        w for k, v in (manifest.get("overrides") or {}).items() for w in ("--set", f"{k}={v}")
    ]
    words += [w for m in manifest["methods"] for w in ("--method", m)]
    words += ["--n", str(manifest["points"])] if manifest.get("points") else []
    lines = [f"git checkout {manifest['commit']}"] if manifest.get("commit") else []
    return [*lines, shlex.join(words), "simbench score again"]
