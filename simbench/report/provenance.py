"""Section of the report: the commands, versions and seeds behind the results, and how to reproduce
them.
"""

import shlex
from typing import Any

import pandas as pd

from simbench.bench.store.manifest import FROM_FILE
from simbench.page.document import Commands, Part, Table, Text
from simbench.report.data import RunData

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


def section(run: RunData) -> list[Part]:
    """Return the manifest of the run and the commands that repeat it."""
    manifest = run.book.manifest
    rows = [(title, manifest.get(key)) for key, title in _SHOWN.items()]
    rows += [("command, methods added", command) for command in manifest.get("added", ())]
    rows += [(f"version of {name}", value) for name, value in manifest.get("versions", {}).items()]
    frame = pd.DataFrame(
        [(name, "" if value is None else str(value)) for name, value in rows],
        columns=["what", "value"],
    )
    one = f"simbench simulate --from {run.folder} --id SCENARIO -o record.csv"
    return [
        Text(f"All numbers on this page come from the tables in {run.folder}, and these from:"),
        Table(frame, long=["value"]),
        Text("How to reproduce", "heading"),
        Commands(reproduce(manifest)),
        Text("One scenario:"),
        Commands([one, "simbench detect record.csv"]),
    ]


def reproduce(manifest: dict[str, Any]) -> list[str]:
    """Return the commands that give the same tables from a checkout of the same commit."""
    words = ["simbench", "run", str(manifest["grid"]), "-o", "again"]
    words += ["--set", f"seed={manifest['seed']}"]
    words += [
        w for k, v in (manifest.get("overrides") or {}).items() for w in ("--set", f"{k}={v}")
    ]
    methods = manifest["methods"].items()
    asked = [name for name, about in methods if about.get("answered") != FROM_FILE]
    words += [word for name in asked for word in ("--method", name)]
    words += ["--n", str(manifest["points"])] if manifest.get("points") else []
    lines = [f"git checkout {manifest['commit']}"] if manifest.get("commit") else []
    return [*lines, shlex.join(words), "simbench score again"]
