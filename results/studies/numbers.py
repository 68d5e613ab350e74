"""Fill the numbers of the pages from the files of results: `python -m results.studies.numbers`.

A number that is followed by a mark, as 194<!--causes.right-->, is never typed: docs/numbers.toml
says which file it stands in and where; nor are the lines of a block below a mark like
<!--lines: first_rank-->. Without an option the pages are written anew; `--check` names every number
and block that is no longer what its file says, and ends with 1.
"""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from simbench.detectors.errors import ParameterError
from simbench.usage import exit_code

ROOT = Path(__file__).parents[2]
_MARKED = re.compile(r"(?P<number>-?(?:\d+\.?\d*|\.\d+))<!--(?P<name>[a-z_]+\.[a-z_0-9]+)-->")
_ANY_MARK = re.compile(r"<!--[a-z_]+\.[a-z_0-9]+-->")
_BLOCK = re.compile(
    r"(?P<head><!--lines: (?P<name>[a-z_]+)-->\n+```text\n)(?P<lines>.*?\n)```\n", re.DOTALL
)


def known_numbers(root: Path = ROOT) -> dict[str, str]:
    """Return every number and every block of lines that a page may quote, as its file has it, by
    name.
    """
    places = tomllib.loads((root / "docs" / "numbers.toml").read_text(encoding="utf-8"))
    known = {}
    for source, place in places.items():
        text = (root / "results" / place["file"]).read_text(encoding="utf-8")
        found = re.search(place["pattern"], text, re.MULTILINE)
        if found is None:
            raise ParameterError(
                f"docs/numbers.toml: {source}: results/{place['file']} has no line like"
                f" {place['pattern']!r}; the pattern that finds it now is needed"
            )
        if "lines" in place:
            known[source] = _block(found[0], place["lines"], f"docs/numbers.toml: {source}")
        groups = found.groupdict()
        known |= {
            f"{source}.{name}": value for name, value in {**groups, **_shares(groups)}.items()
        }
    return known


def _shares(groups: Mapping[str, str]) -> dict[str, str]:
    """Return the share NAME of every pair of groups NAME_k and NAME_of, where no group has that
    name.
    """
    names = [name.removesuffix("_k") for name in groups if name.endswith("_k")]
    return {
        name: str(int(groups[f"{name}_k"]) / int(groups[f"{name}_of"]))
        for name in names
        if f"{name}_of" in groups and name not in groups
    }


def _block(text: str, begins: list[str], where: str) -> str:
    """Return the first line of a text that each of some patterns begins, or all lines."""
    lines = text.splitlines()
    if begins:
        firsts = [next((x for x in lines if re.match(start, x)), None) for start in begins]
        if None in firsts:
            lost = begins[firsts.index(None)]
            raise ParameterError(f"{where}: no line begins like {lost!r}; one is needed")
        lines = firsts
    return "".join(f"{line}\n" for line in lines)


def as_written(number: str, like: str) -> str:
    """Return a number of a file with the decimals, and with or without the leading zero, of the one
    on the page.
    """
    try:
        value = float(number)
    except ValueError:
        raise ParameterError(
            f"a file of results has {number!r} where a page has {like}; a number is needed"
        ) from None
    decimals = len(like.partition(".")[2])
    text = f"{value:.{decimals}f}"
    bare = like.lstrip("-").startswith(".")
    return text.replace("0.", ".", 1) if bare and abs(value) < 1.0 else text


def fill(page: str, known: Mapping[str, str], where: str) -> str:
    """Return a page with every marked number and block as its file has it."""

    def of_file(name: str) -> str:
        if name not in known:
            raise ParameterError(
                f"{where}: mark {name!r} is not in docs/numbers.toml, which needs it"
            )
        return known[name]

    def filled(mark: re.Match[str]) -> str:
        return f"{as_written(of_file(mark['name']), mark['number'])}<!--{mark['name']}-->"

    text = _MARKED.sub(filled, page)
    text = _BLOCK.sub(lambda mark: f"{mark['head']}{of_file(mark['name'])}```\n", text)
    if len(_ANY_MARK.findall(page)) != len(_MARKED.findall(page)):
        raise ParameterError(f"{where}: a mark stands behind no number; one is needed before each")
    if page.count("<!--lines:") != len(_BLOCK.findall(page)):
        raise ParameterError(f"{where}: a mark of lines stands before no block of text")
    return text


def pages(root: Path = ROOT) -> Iterator[Path]:
    """Yield README and every page that is written by hand."""
    yield root / "README.md"
    for path in sorted((root / "docs").rglob("*.md")):
        if not {"generated", "_build"} & set(path.parts):
            yield path


def differing(root: Path = ROOT) -> dict[Path, list[str]]:
    """Return by page the marked numbers that are not what their files say."""
    return _compare(root, known_numbers(root))


def _compare(root: Path, known: Mapping[str, str]) -> dict[Path, list[str]]:
    out: dict[Path, list[str]] = {}
    for path in pages(root):
        text = path.read_text(encoding="utf-8")
        now = _MARKED.finditer(fill(text, known, str(path)))
        wrong = [
            f"{old['name']} is {new['number']}, not {old['number']}"
            for old, new in zip(_MARKED.finditer(text), now, strict=True)
            if old["number"] != new["number"]
        ]
        wrong += [
            f"the lines of {block['name']} are others"
            for block in _BLOCK.finditer(text)
            if block["lines"] != known[block["name"]]
        ]
        if wrong:
            out[path] = wrong
    return out


def main(arguments: list[str] | None = None) -> int:
    """Fill the pages, or say which numbers are no longer true."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.numbers", description=__doc__)
    parser.add_argument("--check", action="store_true", help="Write nothing; 1 if a number is old.")
    chosen = parser.parse_args(arguments)
    known = known_numbers()
    wrong = _compare(ROOT, known)
    for path, lines in wrong.items():
        print("\n".join(f"{path.relative_to(ROOT)}: {line}" for line in lines))
        if not chosen.check:
            text = path.read_text(encoding="utf-8")
            path.write_text(fill(text, known, str(path)), encoding="utf-8")
    return 1 if wrong and chosen.check else 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
