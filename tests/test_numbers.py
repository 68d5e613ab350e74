"""A number that a page quotes from results is that of its file."""

import re
from pathlib import Path

from typer.main import get_command

from results.studies import numbers
from simbench.cli import app
from simbench.gap import thresholds

ROOT = Path(__file__).parents[1]


def copy_of(tmp_path, page, result="of 234 loops: right 194, wrong 20\n"):
    (tmp_path / "docs").mkdir()
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "causes.txt").write_text(result)
    (tmp_path / "docs" / "numbers.toml").write_text(
        '[causes]\nfile = "causes.txt"\n'
        "pattern = 'right (?P<right>\\d+), wrong (?P<wrong>\\d+)'\n"
    )
    (tmp_path / "README.md").write_text(page)
    return tmp_path


def test_every_marked_number_is_that_of_its_file():
    assert numbers.differing() == {}, "run `python -m results.studies.numbers`"


def test_no_number_is_listed_that_no_page_quotes():
    text = "".join(path.read_text(encoding="utf-8") for path in numbers.pages())
    marks = re.findall(r"<!--(?:lines: )?([a-z_]+)(?:\.[a-z_0-9]+)?-->", text)
    quoted = set(marks)
    listed = {name.partition(".")[0] for name in numbers.known_numbers()}
    assert listed == quoted


def test_a_changed_result_without_a_changed_page_is_seen(tmp_path):
    root = copy_of(tmp_path, "190<!--causes.right--> right, 20<!--causes.wrong--> wrong\n")
    assert numbers.differing(root) == {root / "README.md": ["causes.right is 194, not 190"]}
    filled = numbers.fill("190<!--causes.right-->", numbers.known_numbers(root), "page")
    assert filled == "194<!--causes.right-->"


# what stands typed beside results: settings, limits, formulas, and levels of intervals
CONSTANTS = {
    "README.md": "95 .5",
    "docs/cost.md": "15 80",
    "docs/site/concepts/gap.md": "26 2.6 0.85 1.5 64 90",
    "docs/site/tutorials/gap.md": "1.5 90 10",
    "docs/trust.md": "0.41 1.09 0.61 0.79 1.9 20 15 50 0.9 0.2 0.6 0.2 0.2 0.8 60",
}


def typed_numbers():
    """Return by page the numbers without a mark in paragraphs and rows that name a file of
    results.
    """
    found = {}
    for path in numbers.pages():
        for part in re.split(r"\n\s*\n|\n(?=[|\-*] )", path.read_text(encoding="utf-8")):
            if not re.search(r"\b[a-z_]+\.(?:txt|json)\b|results/withheld", part):
                continue
            rest = re.sub(r"\S+<!--.*?-->", "", part)
            # code, links, remarks in brackets, years
            rest = re.sub(r"`[^`]*`|\[[^\]]*\]\([^)]*\)|\([^)]*\)", "", rest)
            typed = re.findall(r"(?<![\w.#/-])(?:\d*\.\d+|\d{2,})(?![\w/-])", rest)
            if typed:
                found.setdefault(str(path.relative_to(ROOT)), []).extend(typed)
    return found


def test_a_number_beside_results_is_marked_or_a_constant():
    assert {page: " ".join(typed) for page, typed in typed_numbers().items()} == CONSTANTS


def test_the_page_on_trust_has_the_numbers_of_the_program():
    page = " ".join((ROOT / "docs" / "trust.md").read_text(encoding="utf-8").split())
    offset, gain, full = thresholds.OFFSET, thresholds.PER_GAIN, thresholds.FULL_NATS
    band, cycles = thresholds.PER_BAND, -thresholds.PER_CYCLES
    assert (
        f"The log-odds of stiction are {offset} + {gain} asinh((*l* + *r*)/{full:g}) + {band} ln"
        f" *b* - {cycles} ln(*c*/10)"
    ) in page
    assert (
        f"is multiplied by {thresholds.SEEN} in a record of at least {thresholds.SEEN_CYCLES:g}"
        f" cycles with at least {thresholds.SEEN_PACE:g} samples each, of which friction explains"
        f" less than {thresholds.EXPLAINS:g} nats, and by {thresholds.HARDLY_SEEN} elsewhere"
    ) in page


# levels of intervals, tables of the chapter, ends of a span, a coin's worth, and a least number
HELP = {"90", "95", "11.1", "11.3", "100", "0.5", "10"}


def texts_of(command):
    """Yield the help of a command, of its options, and of the commands below it."""
    yield command.help or ""
    yield from (getattr(option, "help", None) or "" for option in command.params)
    for below in getattr(command, "commands", {}).values():
        yield from texts_of(below)


def test_help_claims_no_result():
    texts = [re.sub(r"`[^`]*`", "", text) for text in texts_of(get_command(app))]
    assert len(texts) > 100
    found = {
        number
        for text in texts
        for number in re.findall(r"(?<![\w.#/-])(?:\d*\.\d+|\d{2,})(?![\w/-])", text)
    }
    assert found == HELP
