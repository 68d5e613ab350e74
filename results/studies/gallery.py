"""The gallery page: every figure with its picture and what to see in it. `python -m
results.studies.gallery`.
"""

from __future__ import annotations

import argparse
import inspect
import sys
from pathlib import Path

import pandas as pd

from simbench.figures._folder import FIGURES
from simbench.figures._loops import numbers_line
from simbench.figures._make import figure_ids
from simbench.files import whole_file
from simbench.usage import exit_code

HEAD = """# Gallery

Every figure and table of the chapter (M. Jelali, \
Control Performance Management in Industrial Automation, Springer 2013,
chapter 11), drawn from this code. Beside each picture lies a CSV with the numbers drawn. \
`simbench figure all -o
results/figures` draws them, `simbench figure ID -o DIR` one of them, and \
`python -m results.studies.gallery` writes this page.
How every published number compares stands in [chapter against code](chapter_against_code.md).

The chapter's text lost its figure numbers; they are those of its captions, counted. \
Figures 11.1 to 11.3 (block diagram, tank,
valve drawing) and 11.19 (flow chart of Procedure 11.3, \
which `detectors/methods/choudhury.py` follows) hold no numbers
of loops: they are sketches.
"""


def gallery(pictures: Path, page: Path) -> str:
    """Return the page in Markdown.

    `page`: where the page will stand; links are relative to it.
    """
    lines = [HEAD]
    for name in figure_ids():
        module = FIGURES.load(name.replace("-", "_"))
        first, _, rest = inspect.cleandoc(module.__doc__ or "").partition("\n\n")
        first = " ".join(first.split())
        lines += [
            f"## `{name}`",
            "",
            f"**{first}** {' '.join(rest.split())}".rstrip(),
            "",
            f"Source: {module.SOURCE}.",
            "",
        ]
        numbers = pictures / f"{name}.csv"
        if numbers.is_file() and (line := numbers_line(pd.read_csv(numbers))):
            lines += [f"Numbers: {line}.", ""]
        picture = pictures / f"{name}.svg"
        if picture.is_file():
            link = Path(*[".."] * len(page.parent.parts), picture).as_posix()
            lines += [f"![{first}]({link})", "", f"[numbers]({link.removesuffix('.svg')}.csv)", ""]
        else:
            lines += [
                f"Needs the real records: `simbench figure {name} -o DIR --isdb isdb10.mat`.",
                "",
            ]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Write the page; exit code 2 with one sentence when it cannot be written."""
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.gallery", description="Write the gallery of figures."
    )
    parser.add_argument("--pictures", type=Path, default=Path("results/figures"))
    parser.add_argument("-o", "--out", type=Path, default=Path("docs/gallery.md"))
    given = parser.parse_args(arguments)

    def write() -> None:
        text = gallery(given.pictures, given.out)
        with whole_file(given.out) as f:
            f.write(text)

    return exit_code(write)


if __name__ == "__main__":
    sys.exit(main())
