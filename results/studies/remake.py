"""Print results again: `python -m results.studies.remake [FILE ...]` runs the commands that
results/README.md lists and notes at which commit and how long; `--stale` names the results that
are older than their code, with that time.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
import tomllib
from pathlib import Path

from results.studies.stale import LastRun, list_stale
from simbench.detectors.errors import ParameterError, nearest
from simbench.usage import exit_code

ROOT = Path(__file__).parents[2]
PRINTED = "printed.toml"  # in results
_ABOUT = (
    "# when remake last ran each row of README.md: at which commit, and how many minutes it took on"
    " two cores\n"
)


def listed(text: str) -> dict[str, list[str]]:
    """Return, for every row of the table, its file or folder and the shell commands that write it,
    in their order.
    """
    rows = [line.split("|")[1:3] for line in text.splitlines() if line.startswith("| `")]
    return {
        re.findall(r"`([^`]+)`", file)[0]: re.findall(r"`([^`]+)`", commands)
        for file, commands in rows
    }


def last_runs(root: Path) -> dict[str, LastRun]:
    """Return when each row was last run; rows that never were are left out."""
    path = root / "results" / PRINTED
    rows = tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return {name: LastRun(**row) for name, row in rows.items()}


def _note(name: str, run: LastRun) -> None:
    """Write when a row was run beside what is known of the others."""
    known = {**last_runs(ROOT), name: run}
    rows = "".join(
        f'"{row}" = {{ commit = "{known[row].commit}", minutes = {known[row].minutes:.1f} }}\n'
        for row in sorted(known)
    )
    (ROOT / "results" / PRINTED).write_text(_ABOUT + rows, encoding="utf-8")


def _commit() -> str:
    """Return the commit that is checked out; "" outside a git checkout."""
    words = ["git", "rev-parse", "--short=12", "HEAD"]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True).stdout.strip()


def _remake(name: str, commands: list[str], environment: dict[str, str], only_say: bool) -> bool:
    """Run the commands of one row and return whether all went well; a file that a failing command
    left empty is what it was before.

    A study that prints what it found, and that this falls short of a bar, ends with 1: that is no
    failure.
    """
    place = ROOT / "results" / name
    before = place.read_bytes() if place.is_file() else b""
    for command in commands:
        print(f"{name}: {command}", flush=True)
        if only_say:
            continue
        code = subprocess.run(["bash", "-ec", command], cwd=ROOT, env=environment).returncode
        empty = place.is_file() and place.stat().st_size == 0
        if code == 1 and command.startswith("python -m ") and not empty:
            print(f"{name}: printed; it falls short of a bar (exit code 1)", flush=True)
        elif code:
            if before and empty:
                place.write_bytes(before)
            return False
    return True


def main(arguments: list[str] | None = None) -> int:
    """Run the commands of the chosen rows, or of all; 1 when one fails, which is named."""
    table = listed((ROOT / "results" / "README.md").read_text(encoding="utf-8"))
    parser = argparse.ArgumentParser(prog="python -m results.studies.remake", description=__doc__)
    parser.add_argument("files", metavar="FILE", nargs="*", help="As the table names them [all].")
    parser.add_argument("--list", action="store_true", help="Only say what would be run.")
    parser.add_argument(
        "--stale",
        action="store_true",
        help="Only name the results whose code changed since they were printed.",
    )
    chosen = parser.parse_args(arguments)
    for name in chosen.files:
        if name not in table:
            raise ParameterError(
                f"no row of results/README.md is called {name!r}: {nearest(name, table)}"
            )
    if chosen.stale:
        rows = {name: table[name] for name in chosen.files or table}
        old = list_stale(ROOT, rows, last_runs(ROOT))
        print("\n".join(map(str, old)) or "no result is older than its code")
        return 0
    failed = []
    # what this interpreter's environment offers comes first
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    commit = _commit()
    for name in chosen.files or table:
        start = time.monotonic()
        if not _remake(name, table[name], environment, chosen.list):
            failed.append(name)
        elif not chosen.list:
            _note(name, LastRun(commit, (time.monotonic() - start) / 60.0))
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
