"""Command that writes docs/chapter_against_code.md."""

from __future__ import annotations

import argparse
import sys

from results.studies.chapter import page, rows
from simbench.files import whole_file
from simbench.usage import exit_code


def main(arguments: list[str] | None = None) -> int:
    """Write the page; exit code 2 with one sentence when something the user gave is wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.chapter", description="Write 'chapter against code'."
    )
    parser.add_argument("--isdb", help="ISDB file or folder of real records")
    parser.add_argument("-o", "--out", default="docs/chapter_against_code.md")
    given = parser.parse_args(arguments)

    def write() -> None:
        text = page(rows(given.isdb))
        with whole_file(given.out) as f:
            f.write(text)

    return exit_code(write)


if __name__ == "__main__":
    sys.exit(main())
