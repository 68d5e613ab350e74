"""Count words of a private dialect: `python benchmarks/count_words.py [FOLDER ...]`.

A reader who meets "said", "found" or "behind" as a name has to guess what it holds. The table gives
how often each such word occurs per 1000 lines of identifiers, strings, comments and documentation.
An identifier is taken apart at underscores and capitals, so `own_grid` counts as `own`. Field names
of the public contract are counted too, as a reader meets them all the same.
"""

import io
import re
import sys
import tokenize
from collections import Counter
from pathlib import Path

WORDS = ("found", "own", "said", "says", "behind", "beside", "told", "stands")
FOLDERS = ("simbench", "detectors", "scenarios", "tests", "docs", "results/studies", "README.md")
_TEXTS = (".md", ".rst", ".html", ".toml")
_PARTS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")
_READ = (tokenize.NAME, tokenize.STRING, tokenize.COMMENT)


def files(names):
    """Yield the Python files and texts of files and folders."""
    for name in names:
        path = Path(name)
        for file in [path] if path.is_file() else sorted(path.rglob("*")):
            if file.suffix == ".py" or file.suffix in _TEXTS:
                yield file


def words_of(file):
    """Return how often each word occurs in a file, in lower case."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".py":
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        text = " ".join(token.string for token in tokens if token.type in _READ)
    return Counter(part.lower() for part in _PARTS.findall(text))


def main(names):
    """Print one line per folder and one for all of them."""
    total, lines = Counter(), 0
    print(f"{'per 1000 lines':20s}" + "".join(f"{word:>8s}" for word in (*WORDS, "all")))
    for name in names:
        here, count = Counter(), 0
        for file in files([name]):
            here += words_of(file)
            count += file.read_text(encoding="utf-8").count("\n")
        print_row(name, here, count)
        total, lines = total + here, lines + count
    print_row("all", total, lines)


def print_row(name, counted, lines):
    """Print how often each word occurs per 1000 lines."""
    rates = [1000 * counted[word] / max(lines, 1) for word in WORDS]
    print(f"{name:20s}" + "".join(f"{rate:8.2f}" for rate in (*rates, sum(rates))))


if __name__ == "__main__":
    main(sys.argv[1:] or FOLDERS)
